"""What --inspect says of a bag, and that the map it writes works as it stands."""

from dataclasses import replace

import pytest
from click.testing import CliRunner
from support.bags import IMAGE, RecordingBag, Variant, write_bag
from support.toy_world import street

from semgrid_eval.cli.main import cli
from semgrid_eval.log.store import find_logs
from semgrid_eval.sources.ros2.inspection import inspect_bags

WORLD = street(1, frames=5)


def inspected(here, messages):
    """Inspect a bag of messages; what is said, and the map."""
    write_bag(here / "drive", messages)
    said = inspect_bags([here / "drive"], here / "map.yaml")
    return said, (here / "map.yaml").read_text()


def row(said, topic):
    (line,) = (line for line in said.splitlines() if line.startswith(f"{topic} "))
    return line.split()


@pytest.mark.parametrize("depth", ["disparity", "16UC1"])
@pytest.mark.parametrize("motion", ["odometry", "imu"])
@pytest.mark.parametrize("image", ["rgb8", "jpeg"])
def test_the_first_map_works_as_it_stands(tmp_path, monkeypatch, depth, motion, image):
    monkeypatch.chdir(tmp_path)
    RecordingBag(WORLD.recording(), Variant("sqlite3", image, depth, "png", motion)).write(tmp_path / "drive")
    steps = [["convert", "ros2", "drive", "--inspect"], ["convert", "ros2", "drive", "logs", "--workers", "1"]]
    for arguments in steps:
        result = CliRunner().invoke(cli, arguments, standalone_mode=False)
        assert result.return_value == 0, result.output
    assert [log.stem for log in find_logs(tmp_path / "logs")] == ["drive_000000"]
    assert "5 of 5 frames; no frame left out" in result.stderr


def test_topics_are_listed_with_rate_and_offset(tmp_path):
    said, _ = inspected(tmp_path, RecordingBag(WORLD.recording()).messages())
    assert " ".join(row(said, "/labels")) == "/labels sensor_msgs/msg/Image 5 17 5.0 mono8 of 256 x 128"
    assert row(said, "/odom") == ["/odom", "nav_msgs/msg/Odometry", "5", "17", "4.0"]
    assert row(said, "/tf_static")[2:] == ["1", "-", "-"]


def test_what_nothing_links_is_left_to_be_measured(tmp_path):
    messages = [each for each in RecordingBag(WORLD.recording()).messages() if each.topic != "/tf_static"]
    _, text = inspected(tmp_path, messages)
    assert "# Nothing in the bag links base_link to camera_left_optical: measure where the camera sits." in text
    result = CliRunner().invoke(
        cli,
        ["convert", "ros2", f"{tmp_path}/drive", f"{tmp_path}/logs", "--map", f"{tmp_path}/map.yaml"],
        standalone_mode=False,
    )
    assert str(result.exception).startswith(f"{tmp_path}/map.yaml: cameras.front.extrinsics.x_m: ")


def test_a_pair_is_matched_where_nothing_else_tells_the_depth(tmp_path):
    messages = []
    for each in RecordingBag(WORLD.recording(), Variant(labels="")).messages():
        messages += [each] if each.topic != "/stereo/disparity" else []
        messages += [each._replace(topic=IMAGE.replace("left", "right"))] if each.topic == IMAGE else []
    _, text = inspected(tmp_path, messages)
    assert "    right: /stereo/right/image_rect_color" in text
    assert "    right_info: /stereo/right/camera_info" in text
    assert "# no labels: `semgrid-eval segment` adds them to the logs" in text


def test_train_ids_are_told_by_the_first_image(tmp_path):
    messages = [
        each._replace(message=replace(each.message, data=each.message.data % 19)) if each.topic == "/labels" else each
        for each in RecordingBag(WORLD.recording()).messages()
    ]
    _, text = inspected(tmp_path, messages)
    assert "    ids: train_ids  # the first image holds ids up to" in text


def test_without_stamps_the_recorders_clock_is_proposed(tmp_path):
    messages = list(RecordingBag(WORLD.recording()).messages())
    for each in messages:
        if hasattr(each.message, "header"):
            each.message.header.stamp.sec = each.message.header.stamp.nanosec = 0
    said, text = inspected(tmp_path, messages)
    assert " ".join(row(said, "/odom")).endswith("header stamps are all zero")
    assert "clock: received  # header stamps are all zero" in text


def test_a_map_that_is_there_stays(tmp_path):
    RecordingBag(WORLD.recording()).write(tmp_path / "drive")
    (tmp_path / "map.yaml").write_text("mine")
    said = inspect_bags([tmp_path / "drive"], tmp_path / "map.yaml")
    assert "/odom" in said
    assert said.endswith("map.yaml is there already and stays; --map names another one to write")
    assert (tmp_path / "map.yaml").read_text() == "mine"


def test_out_is_needed_without_inspect(tmp_path):
    RecordingBag(WORLD.recording()).write(tmp_path / "drive")
    result = CliRunner().invoke(cli, ["convert", "ros2", f"{tmp_path}/drive"])
    assert result.exit_code == 2
    assert "Missing argument 'BAG...'" in result.output
