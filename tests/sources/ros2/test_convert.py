"""Recordings written as bags by `rosbags`, and converted: what comes back is what went in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.bags import IMAGE, RecordingBag, Sent, Variant, write_bag
from support.onnx_models import colour_network
from support.ros_messages import camera_info, compressed, matrix
from support.toy_world import HEIGHT, WIDTH, street

from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.check import check_log
from semgrid_eval.log.convert import Work
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, write_log
from semgrid_eval.recording.colour import decode_colour, kind_of
from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.relabel import segment_logs
from semgrid_eval.sources.ros2.cameras import Info, rectification_of
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

FRAMES = 6
WORLD = street(1, frames=FRAMES)
PLAIN = Variant()


def converted(here: Path, variant: Variant = PLAIN, messages=None, *, text=None, **options):
    """Write a bag `drive` and its map, convert it, and return the summary and the logs."""
    bag = RecordingBag(WORLD.recording(), variant)
    write_bag(here / "drive", bag.messages() if messages is None else messages, variant.storage)
    (here / "map.yaml").write_text(text or variant.map_text)
    summary = convert_bags(Ros2Options(bag=(here / "drive",), map=str(here / "map.yaml"), **options), here / "logs")
    return summary, find_logs(here / "logs") if summary.written else []


def frames_of(log):
    with LogReader(log) as reader:
        return list(reader.frames("front", images=True))


def originals():
    return [moment.cameras["front"] for moment in WORLD.recording().moments()]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize(("image", "motion"), [("rgb8", "odometry"), ("bgr8", "twist"), ("png", "imu")])
def test_a_bag_holds_what_its_recording_held(tmp_path, storage, image, motion):
    labels = "png" if image == "png" else "mono8"
    summary, (log,) = converted(tmp_path, Variant(storage, image, labels=labels, motion=motion))
    assert summary.written == ["val/drive_000000"]
    for found, expected in zip(frames_of(log), originals(), strict=True):
        assert found.stamp_ns == expected.stamp_ns
        assert np.array_equal(decode_colour(found.image_file), decode_colour(expected.image_file))
        for name, bits in (("disparity_png", 16), ("label_png", 8)):
            ours, theirs = (decode_gray(getattr(each, name), bit_depth=bits) for each in (found, expected))
            assert np.array_equal(ours, theirs)
    with LogReader(log) as reader:
        told = [sample for moment in WORLD.recording().moments() for sample in moment.motion]
        assert reader.motion() == told
        ours, theirs = reader.calibration("front"), WORLD.calibration()
        assert np.allclose(list(vars(ours).values()), list(vars(theirs).values()), rtol=1e-12, atol=1e-12)
        assert (reader.scene.dataset, reader.scene.group) == ("ros2", "drive")


def test_grids_of_a_bag_are_those_of_its_recording(tmp_path):
    _, (log,) = converted(tmp_path)
    write_log(WORLD.recording(), tmp_path / "toy.mcap")
    (ours,), (theirs,) = (build_log(each, GridConfig()) for each in (log, tmp_path / "toy.mcap"))
    assert (theirs.grids > 0).any()
    assert np.array_equal(ours.grids, theirs.grids)


def test_files_are_stored_as_they_come(tmp_path):
    bag = RecordingBag(WORLD.recording(), Variant(image="jpeg"))
    sent = [bytes(each.message.data) for each in bag.messages() if each.topic == IMAGE]
    _, (log,) = converted(tmp_path, bag.variant)
    assert [frame.image_file for frame in frames_of(log)] == sent
    assert check_log(log).findings == ()
    assert segmented(tmp_path, log) == {LABEL_ID["road"]}


def segmented(here, log):
    """Label a log by a network that sees road everywhere, and return its label ids."""
    model = colour_network(here / "road.onnx", colours={0: (0.0, 0.0, 0.0)})
    assert segment_logs([log], model, SegmentationConfig(), here / "labelled").failed == {}
    (labelled,) = find_logs(here / "labelled")
    return {int(each) for frame in frames_of(labelled) for each in np.unique(decode_gray(frame.label_png, bit_depth=8))}


def test_raw_images_are_rectified_and_stored_without_loss(tmp_path):
    lens = (-0.2, 0.05, 0.0, 0.0, 0.0)
    k = matrix(WORLD.calibration())
    bag = RecordingBag(WORLD.recording(), Variant(image="jpeg", depth="16UC1"))
    messages = [
        each._replace(message=camera_info(1, (WIDTH, HEIGHT), k, d=lens)) if "left/camera_info" in each.topic else each
        for each in bag.messages()
    ]
    text = bag.variant.map_text.replace("rectified: true", "rectified: false")
    _, (log,) = converted(tmp_path, messages=messages, text=text)
    rectification = rectification_of(Info.of(camera_info(1, (WIDTH, HEIGHT), k, d=lens)), rectified=False)
    photos = [decode_colour(bytes(each.message.data)) for each in messages if each.topic == IMAGE]
    for frame, photo, expected in zip(frames_of(log), photos, originals(), strict=True):
        assert kind_of(frame.image_file) == "png"
        assert np.array_equal(decode_colour(frame.image_file), rectification.apply(photo, "bilinear"))
        labels = decode_gray(expected.label_png, bit_depth=8).astype(np.uint8)
        found = decode_gray(frame.label_png, bit_depth=8)
        assert np.array_equal(found, rectification.apply(labels, "nearest"))
        assert not np.array_equal(found, labels)


@pytest.mark.parametrize(("depth", "error_m"), [("32FC1", 0.0), ("16UC1", 5e-4), ("compressedDepth", 5e-4)])
def test_depth_becomes_disparity_within_its_coding(tmp_path, depth, error_m):
    summary, (log,) = converted(tmp_path, Variant(depth=depth))
    calibration = WORLD.calibration()
    depth_px = calibration.fx_px * calibration.baseline_m
    for found, expected in zip(frames_of(log), originals(), strict=True):
        ours, theirs = (decoded_disparity(decode_gray(each.disparity_png, bit_depth=16)) for each in (found, expected))
        near = (theirs > depth_px / 65.0) if error_m else theirs > 0  # 16 bits of mm end at 65.535 m
        assert near.any()
        bound_px = 1 / 512 + theirs[near] ** 2 / depth_px * error_m + 1e-3
        assert (np.abs(ours - theirs)[near] <= bound_px).all()
        assert (ours[theirs == 0] == 0).all()
    assert "disparity is rounded by at most 1/512 px" in summary.remark


def test_motion_by_poses_leads_where_the_poses_were(tmp_path):
    world = replace(WORLD, yaw_rate_radps=0.2, frames=12)
    bag = RecordingBag(world.recording(), Variant(motion="pose"))
    _, (log,) = converted(tmp_path, bag.variant, bag.messages())
    with LogReader(log) as reader:
        samples = reader.motion()
    assert np.allclose([each.yaw_rate_radps for each in samples], 0.2, atol=1e-6)
    assert np.allclose([each.speed_mps for each in samples], world.speed_mps, rtol=1e-6)


def test_a_single_file_gives_the_same_log_as_its_folder(tmp_path):
    for storage, suffix in (("mcap", "mcap"), ("sqlite3", "db3")):
        here = tmp_path / storage
        here.mkdir()
        _, (log,) = converted(here, Variant(storage))
        options = Ros2Options(bag=(here / "drive" / f"drive.{suffix}",), map=str(here / "map.yaml"))
        assert convert_bags(options, here / "again").written == ["val/drive_000000"]
        assert (here / "again" / "val" / log.name).read_bytes() == log.read_bytes()
    assert (tmp_path / "mcap/again/val" / log.name).read_bytes() == log.read_bytes()


@pytest.mark.parametrize(
    ("storage", "packed"), [("mcap", "STORAGE"), ("mcap", "MESSAGE"), ("sqlite3", "MESSAGE"), ("sqlite3", "FILE")]
)
def test_packed_bags_give_the_same_log(tmp_path, storage, packed):
    _, (expected,) = converted(tmp_path)
    write_bag(tmp_path / "packed" / "drive", RecordingBag(WORLD.recording()).messages(), storage, packed)
    options = Ros2Options(bag=(tmp_path / "packed" / "drive",), map=str(tmp_path / "map.yaml"))
    convert_bags(options, tmp_path / "again")
    assert (tmp_path / "again" / "val" / expected.name).read_bytes() == expected.read_bytes()


def test_a_second_conversion_leaves_logs_as_they_are_until_the_bag_changes(tmp_path):
    converted(tmp_path)
    options = Ros2Options(bag=(tmp_path / "drive",), map=str(tmp_path / "map.yaml"))
    assert convert_bags(options, tmp_path / "logs").skipped == ["val/drive_000000"]
    messages = list(RecordingBag(WORLD.recording()).messages())
    place = next(number for number, each in enumerate(messages) if each.topic == "/labels")
    messages[place].message.data[0] ^= 3
    write_bag(tmp_path / "b" / "drive", messages)
    changed = Ros2Options(bag=(tmp_path / "b" / "drive",), map=str(tmp_path / "map.yaml"))
    assert convert_bags(changed, tmp_path / "logs").written == ["val/drive_000000"]


def test_bags_are_cut_into_equal_parts_that_share_a_group(tmp_path):
    summary, logs = converted(tmp_path, recording_s=0.2, split="train")
    assert summary.written == ["train/drive_000000", "train/drive_000003"]
    assert [len(frames_of(log)) for log in logs] == [3, 3]
    with LogReader(logs[1]) as second:
        assert second.scene.group == "drive"
        assert second.motion()[0].stamp_ns <= frames_of(logs[1])[0].stamp_ns
    whole = [frame.stamp_ns for log in logs for frame in frames_of(log)]
    assert whole == [frame.stamp_ns for frame in originals()]


def test_frames_that_lack_a_picture_are_left_out_and_end_a_recording(tmp_path):
    labels = [each.received_ns for each in RecordingBag(WORLD.recording()).messages() if each.topic == "/labels"]
    messages = [each for each in RecordingBag(WORLD.recording()).messages() if each.received_ns != labels[2]]
    summary, logs = converted(tmp_path, messages=messages)
    assert summary.written == ["val/drive_000000", "val/drive_000002"]
    assert [len(frames_of(log)) for log in logs] == [2, 3]
    assert "5 of 6 frames; frames left out: 1 without labels" in summary.remark


def test_pictures_are_paired_by_stamps_not_by_when_they_were_recorded(tmp_path):
    messages = [
        each._replace(received_ns=each.received_ns + 200_000_000) if each.topic == "/labels" else each
        for each in RecordingBag(WORLD.recording()).messages()
    ]
    _, (log,) = converted(tmp_path, messages=sorted(messages, key=lambda each: each.received_ns))
    for found, expected in zip(frames_of(log), originals(), strict=True):
        assert np.array_equal(*(decode_gray(each.label_png, bit_depth=8) for each in (found, expected)))


def test_the_recorders_clock_serves_where_messages_have_none(tmp_path):
    messages = list(RecordingBag(WORLD.recording(), Variant(late_ns=0)).messages())
    for each in messages:
        if hasattr(each.message, "header"):
            each.message.header.stamp.sec = each.message.header.stamp.nanosec = 0
    text = "clock: received\n" + Variant().map_text
    _, (log,) = converted(tmp_path, messages=messages, text=text)
    assert [frame.stamp_ns for frame in frames_of(log)] == [frame.stamp_ns + 500_000 for frame in originals()]


def test_without_labels_the_log_is_written_and_segment_is_named(tmp_path):
    summary, (log,) = converted(tmp_path, Variant(labels=""))
    assert all(frame.label_png is None for frame in frames_of(log))
    assert "no labels for front: add them with semgrid-eval segment" in summary.remark


def test_where_the_vehicle_frame_stands_is_added_to_the_mounting(tmp_path):
    text = "vehicle: {height_m: 0.3, rear_axle_m: 1.4}\n" + Variant().map_text
    _, (log,) = converted(tmp_path, text=text)
    with LogReader(log) as reader:
        found = reader.calibration("front")
    assert (found.x_m, found.z_m) == pytest.approx((1.7 + 1.4, 1.22 + 0.3))


def test_bags_that_fail_are_named_and_the_others_converted(tmp_path):
    RecordingBag(WORLD.recording()).write(tmp_path / "good")
    write_bag(tmp_path / "bad", [each for each in RecordingBag(WORLD.recording()).messages() if each.topic != "/odom"])
    (tmp_path / "map.yaml").write_text(Variant().map_text)
    options = Ros2Options(bag=(tmp_path / "bad", tmp_path / "good"), map=str(tmp_path / "map.yaml"))
    summary = convert_bags(options, tmp_path / "logs", Work(workers=2))
    assert summary.written == ["val/good_000000"]
    assert list(summary.failed) == ["val/bad"]


def test_two_cameras_keep_their_own_frames(tmp_path):
    text = Variant().map_text
    camera = text[text.index("  front:") :]
    _, (log,) = converted(tmp_path, text=text + camera.replace("front", "rear"))
    with LogReader(log) as reader:
        assert reader.scene.cameras == ("front", "rear")
        assert [len(list(reader.frames(each))) for each in reader.scene.cameras] == [FRAMES, FRAMES]


def test_a_broken_jpeg_fails_its_recording_alone(tmp_path):
    messages = list(RecordingBag(WORLD.recording(), Variant(image="jpeg")).messages())
    places = [number for number, each in enumerate(messages) if each.topic == IMAGE]
    last = messages[places[-1]]
    stamp_ns = originals()[-1].stamp_ns
    messages[places[-1]] = Sent(IMAGE, last.received_ns, compressed(stamp_ns, bytes(last.message.data)[:-700], "jpeg"))
    summary, _ = converted(tmp_path, Variant(image="jpeg"), messages, recording_s=0.2)
    assert summary.written == ["val/drive_000000"]
    assert f"/camera/front/image at {stamp_ns} ns: is a damaged JPEG file" in summary.failed["val/drive_000003"]
