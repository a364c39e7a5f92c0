"""What --inspect says of point clouds, and that the LiDARs of the map it writes work as they stand."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from support.bags import LATE_NS, RecordingBag, Sent, write_bag
from support.rig_bags import Coding, RigBag
from support.ros_messages import OPTICAL, cloud, no_cloud
from support.swept import START_NS, Drive, recorded, scanned
from support.toy_world import street

from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.sources.ros2.clouds_seen import TimesSeen
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.inspection import inspect_bags
from semgrid_eval.sources.ros2.mapping import PointTimes, load_map
from semgrid_eval.sources.ros2.options import Ros2Options

PLACES = [(5.0, 1.0), (9.0, -2.0), (14.0, 3.0)]
RECORDING = scanned(Drive(), range(0, 300_000_000, 100_000_000), PLACES)


def inspected(here, messages):
    """Inspect a bag of messages; what is said, and the map."""
    write_bag(here / "drive", messages)
    said = inspect_bags([here / "drive"], here / "map.yaml")
    return said, (here / "map.yaml").read_text()


def test_fields_are_listed(tmp_path):
    said, _ = inspected(tmp_path, RigBag(RECORDING).messages())
    (line,) = (line for line in said.splitlines() if line.startswith("/top/points "))
    rest = " ".join(line.split()).removeprefix("/top/points sensor_msgs/msg/PointCloud2 3 10 4.0 ")
    assert rest == "3 x 1 points of x, y, z, intensity float32; ring, label uint16"


def test_the_first_map_of_a_lidar_alone_works_as_it_stands(tmp_path):
    _, text = inspected(tmp_path, RigBag(RECORDING).messages())
    assert "cameras" not in text
    assert "    label_field: label\n    ids: train_ids  # the first cloud holds ids up to 17; or names: " in text
    assert "    # extrinsics: from tf, base_link to top\n" in text
    options = Ros2Options(bag=(tmp_path / "drive",), map=str(tmp_path / "map.yaml"))
    assert convert_bags(options, tmp_path / "logs").written == ["val/drive_000000"]
    with LogReader(find_logs(tmp_path / "logs")[0]) as log:
        assert [len(sweep.points_m) for sweep in log.sweeps("top")] == [3, 3, 3]


def drafted(here, columns, frame="lidar"):
    """The LiDARs of the map of a bag with a camera, and one cloud of columns by name."""
    types = [(name, np.asarray(values).dtype) for name, values in columns.items()]
    points = np.zeros(len(next(iter(columns.values()))), types)
    for name, values in columns.items():
        points[name] = values
    messages = list(RecordingBag(street(1, frames=3).recording()).messages())
    sent = Sent("/velodyne/points", messages[-1].received_ns, cloud(START_NS, points, frame=frame))
    return inspected(here, [*messages, sent])[1]


PLACE = dict(zip("xyz", np.ones((3, 4), np.float32), strict=True))
TURN_S = np.linspace(0, 0.1, 4)
TIMES = {
    "velodyne": ("time", (TURN_S - 0.1).astype(np.float32), "{field: time, unit: s, since: stamp}"),
    "ouster": ("t", (TURN_S * 1e9).astype(np.uint32), "{field: t, unit: ns, since: stamp}"),
    "microseconds": ("offset_time", (TURN_S * 1e6).astype(np.uint32), "{field: offset_time, unit: us, since: stamp}"),
    "hesai": ("timestamp", 1.7e9 + TURN_S, "{field: timestamp, unit: s, since: epoch}"),
    "livox": ("timestamp", 1.7e18 + TURN_S * 1e9, "{field: timestamp, unit: ns, since: epoch}"),
}


@pytest.mark.parametrize("maker", TIMES)
def test_times_of_points_are_drafted_with_their_unit(tmp_path, maker):
    name, values, expected = TIMES[maker]
    text = drafted(tmp_path, PLACE | {name: values})
    assert f"    times: {expected}  # of each point" in text
    assert yaml.safe_load(text)["lidars"]["top"]["cloud"] == "/velodyne/points"
    assert yaml.safe_load(text)["cameras"].keys() == {"front"}


def test_the_unit_of_packets_is_that_in_which_they_fill_the_time_to_the_next_one():
    packet = TimesSeen("t", 0.0, 500.0)
    assert packet.guess(1.3e6) == PointTimes(field="t", unit="us")
    assert packet.guess(None) == PointTimes(field="t", unit="ms")
    assert TimesSeen("t", 0.0, 0.1).guess(5e9) == PointTimes(field="t", unit="s"), "clouds that were thinned out"


def test_times_that_are_all_zero_tell_no_unit(tmp_path):
    text = drafted(tmp_path, PLACE | {"t": np.zeros(4, np.uint32)})
    assert "times" not in yaml.safe_load(text)["lidars"]["top"]
    assert "    # times: {field: t, unit: , since: }  # the first cloud does not tell the unit of t; " in text


def test_what_cannot_be_guessed_is_left_open(tmp_path):
    text = drafted(tmp_path, PLACE)
    assert "    # no times of points: all of a cloud count as measured at its stamp\n" in text
    assert "    # no labels of points: a camera can colour them, `colour_from` of the sensor in a grid\n" in text
    assert "    # Nothing in the bag links base_link to lidar: measure where it sits.\n" in text
    assert "    extrinsics: {x_m: , y_m: , z_m: , " in text


@pytest.mark.parametrize(
    ("labels", "kind", "ids"),
    [
        ([0, 13, 18, 2], np.uint32, "train_ids"),
        ([7, 26, 33, 0], np.uint32, "label_ids"),
        ([40, 252, 7 << 16, 70], np.uint32, "semantickitti"),
        ([40, 252, 10, 70], np.uint8, "semantickitti"),
        ([40, 252, 10, 70], np.int16, "semantickitti"),
        ([35, 0, 0, 0], np.uint8, "label_ids"),
    ],
)
def test_ids_of_labels_are_guessed(tmp_path, labels, kind, ids):
    assert f"    ids: {ids}  # the first" in drafted(tmp_path, PLACE | {"label": np.array(labels, kind)})


def test_clouds_that_are_made_of_pictures_are_left_out(tmp_path):
    text = drafted(tmp_path, PLACE, frame=OPTICAL)
    assert "lidars" not in yaml.safe_load(text)
    assert "# /velodyne/points has the frame of a camera, as points made of its pictures have: left out.\n" in text


def test_several_lidars_are_named_by_their_topics(tmp_path):
    def moments():
        for moment in RECORDING.moments():
            yield replace(moment, sweeps={"left/lidar": moment.sweeps["top"], "right/lidar": moment.sweeps["top"]})

    inspected(tmp_path, RigBag(recorded(moments), Coding(labels="")).messages())
    lidars = load_map(tmp_path / "map.yaml").lidars
    assert {name: lidar.cloud for name, lidar in lidars.items()} == {
        "left": "/left/lidar/points",
        "right": "/right/lidar/points",
    }


def test_a_cloud_that_cannot_be_read_is_told_and_not_drafted(tmp_path):
    messages = list(RecordingBag(street(1, frames=3).recording()).messages())
    points = np.zeros(2, [("range", "f4")])
    sent = [
        Sent("/ranges", messages[-1].received_ns, cloud(START_NS + LATE_NS, points)),
        Sent("/nothing", messages[-1].received_ns, no_cloud(START_NS + LATE_NS)),
    ]
    said, text = inspected(tmp_path, [*messages, *sent])
    assert "has no field x; there are: range" in said
    assert "has no field x; there are: none" in said
    assert "lidars:" not in text


def test_names_in_a_bag_can_neither_move_a_cursor_nor_add_to_the_map(tmp_path):
    """A field that clears a screen, a frame of two lines, and a vehicle whose frame is no plain word."""
    odd = cloud(START_NS, np.zeros(2, [(name, "f4") for name in "xyz"]), frame="top\ncameras: [")
    odd.fields.append(replace(odd.fields[0], name="\x1b[2J"))
    messages = [each._replace(message=odd) if "points" in each.topic else each for each in RigBag(RECORDING).messages()]
    for each in messages:
        if each.topic == "/odom":
            each.message.child_frame_id = "a: b"
    links = [each for each in messages if each.topic != "/tf_static"]
    said, text = inspected(tmp_path, links)
    assert "x, y, z, \\x1b[2J float32" in said
    told = yaml.safe_load(text)
    assert told["vehicle"]["frame"] == "a: b"
    assert told.keys() == {"vehicle", "motion", "lidars"}
    assert "links a: b to top\\ncameras: [" in text
