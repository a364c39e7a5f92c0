import json
import os
import pickle
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cityscapes_tree import CAMERA, FRAME_NS, Tree, change_json, fault, frames, only, put, sequences

from semgrid_eval.errors import InputError
from semgrid_eval.recording.types import CameraCalibration, MotionSample
from semgrid_eval.sources.cityscapes.tree import recording_starts


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path / "src")


# What a whole tree gives


def test_pictures_pass_through_byte_by_byte(tree):
    names = tree.write(range(3))
    for frame, name in zip(frames(only(tree)), names, strict=True):
        assert frame.image_file == tree.image(name).read_bytes()
        assert frame.disparity_png == tree.disparity(name).read_bytes()
        assert frame.label_png is None


def test_motion_and_calibration_are_read(tree):
    (name,) = tree.write([4])
    recording = only(tree).recording()
    stamp_ns = 10**15 + 4 * FRAME_NS
    (moment,) = recording.moments()
    assert moment.motion == (MotionSample(stamp_ns, 5.04, 0.02, 50.7, 6.1, 271.5),)
    assert moment.stamp_ns == stamp_ns
    values = {**CAMERA["intrinsic"], **CAMERA["extrinsic"]}
    assert recording.calibrations["front"] == CameraCalibration(
        values["fx"],
        values["fy"],
        values["u0"],
        values["v0"],
        values["baseline"],
        values["x"],
        values["y"],
        values["z"],
        values["roll"],
        values["pitch"],
        values["yaw"],
    )
    assert recording.source_files == {"front_camera.json": tree.camera(name).read_bytes()}


def test_name_split_and_origin_are_kept(tree):
    tree.write(range(294, 300), sequence=2)
    recording = only(tree, camera_name="left").recording()
    assert (recording.name, recording.split, recording.dataset) == ("aachen_000002_000294", "val", "cityscapes")
    assert recording.group == "aachen"
    assert list(recording.calibrations) == ["left"]


def test_recordings_can_be_streamed_again(tree):
    tree.write(range(2))
    recording = only(tree).recording()
    assert list(recording.moments()) == list(recording.moments())


def test_sequences_of_all_splits_and_cities_come_sorted(tree):
    for split, city in (("val", "ulm"), ("train", "stuttgart_00"), ("test", "bonn"), ("train", "aachen")):
        Tree(tree.root, split=split, city=city).write(range(2))
    found = [(sequence.split, sequence.name) for sequence in sequences(tree)]
    assert found == [
        ("test", "bonn_000000_000000"),
        ("train", "aachen_000000_000000"),
        ("train", "stuttgart_00_000000_000000"),
        ("val", "ulm_000000_000000"),
    ]
    assert {sequence.split for sequence in sequences(tree, split=("val", "test"))} == {"val", "test"}


def test_files_whose_names_begin_with_a_dot_are_ignored(tree, tmp_path):
    tree.gt_fine = True
    for name in tree.write(range(2)):
        put(tmp_path / "labels" / f"{name}_labelIds.png", tree.label())
    plain, labelled = only(tree), only(tree, labels=tmp_path / "labels")
    for path in (*tree.root.rglob("*.*"), *(tmp_path / "labels").iterdir()):
        put(path.with_name(f"._{path.name}"), b"\0\5\x16\7")
    assert sequences(tree) == [plain]
    assert sequences(tree, labels=tmp_path / "labels") == [labelled]


def test_gps_may_be_absent(tree):
    (name,) = tree.write([0])
    change_json(tree.vehicle(name), lambda value: (value.pop("gpsLatitude"), value.update(gpsHeading=None)))
    (moment,) = only(tree).recording().moments()
    (sample,) = moment.motion
    assert (sample.latitude_deg, sample.longitude_deg, sample.heading_deg) == (None, 6.1, None)


def test_camera_may_be_given_for_one_frame_only(tree):
    tree.camera_every_frame = False
    names = tree.write(range(30))
    assert [tree.camera(name).exists() for name in names].index(True) == 19
    assert only(tree).recording().calibrations["front"].fx_px == CAMERA["intrinsic"]["fx"]


def test_sequences_travel_to_another_process(tree):
    tree.write(range(2))
    sequence = only(tree)
    again = pickle.loads(pickle.dumps(sequence))
    assert again == sequence
    assert again.digest() == sequence.digest()


# Where recordings begin


@pytest.mark.parametrize(
    ("numbers", "starts"),
    [
        (range(30), []),
        (range(10), []),
        (range(5, 95), []),
        ([*range(30), *range(31, 61)], [30]),
        ([*range(294, 324), *range(333, 363), *range(363, 393)], [30]),
        ([*range(10), *range(30, 60)], [10]),
        ([*range(10), *range(29, 59)], []),
        ([*range(12), *range(13, 30), *range(100, 130)], [29]),
        ([*range(50), *range(60, 90)], [50]),
        ([*range(50), *range(59, 89)], []),
        ([*range(50), *range(51, 60), *range(61, 91)], [59]),
    ],
)
def test_recordings_are_cut_at_breaks_that_end_a_stretch_of_thirty(numbers, starts):
    assert recording_starts(list(numbers)) == starts


@given(st.lists(st.tuples(st.integers(1, 4), st.integers(1, 40)), min_size=1, max_size=6))
def test_whole_recordings_are_told_apart_by_any_break(plan):
    numbers, expected, now = [], [], 7
    for stretches, pause in plan:
        expected.append(len(numbers))
        numbers += range(now, now + 30 * stretches)
        now += 30 * stretches + pause
    assert recording_starts(numbers) == expected[1:]


@given(st.integers(1, 3), st.integers(1, 28), st.data())
def test_any_loss_inside_a_stretch_of_thirty_is_no_new_recording(stretches, lost, data):
    numbers = list(range(100, 100 + 30 * stretches))
    stretch = data.draw(st.integers(0, stretches - 1))
    first = data.draw(st.integers(1, 29 - lost)) + 30 * stretch
    del numbers[first : first + lost]
    assert recording_starts(numbers) == []


def test_recordings_of_one_running_number_become_several_logs(tree):
    tree.write([*range(294, 324), *range(333, 363)])
    assert [sequence.name[-6:] for sequence in sequences(tree)] == ["000294", "000333"]
    assert [len(sequence.frames) for sequence in sequences(tree)] == [30, 30]


# The digest


def test_digest_changes_with_any_file_and_option_and_with_nothing_else(tree, tmp_path):
    tree.gt_fine = True
    (name,) = tree.write([0])
    put(tmp_path / "labels" / f"{name}.png", tree.label())
    seen = [only(tree).digest()]
    assert only(tree).digest() == seen[0]
    tree.vehicle(name).touch()
    assert only(tree).digest() == seen[0]
    seen += [only(tree, camera_name="left").digest(), only(tree, labels=tmp_path / "labels").digest()]
    for path in (
        *(tree.image(name), tree.disparity(name), tree.vehicle(name)),
        *(tree.timestamp(name), tree.camera(name), tree.gt(name)),
    ):
        path.write_bytes(path.read_bytes() + b" ")
        seen.append(only(tree).digest())
    tree.gt(name).unlink()
    seen.append(only(tree).digest())
    assert len(set(seen)) == len(seen)


# Faults: each names its file


@pytest.mark.parametrize("channel", ["disparity", "vehicle", "timestamp"])
def test_missing_file_of_a_frame_is_named(tree, channel):
    names = tree.write(range(4))
    path = getattr(tree, channel)(names[2])
    path.unlink()
    assert fault(tree) == f"{path}: is missing"


def test_lost_frame_is_named(tree):
    names = tree.write(range(30))
    tree.image(names[12]).unlink()
    assert fault(tree) == f"{tree.image(names[12])}: is missing: a gap in the numbering"


def test_sequence_without_any_camera_file_is_named(tree):
    names = tree.write(range(3))
    for name in names:
        tree.camera(name).unlink()
    assert fault(tree).startswith(f"{tree.camera(names[0])}: is missing, as for every frame")


def test_camera_files_that_differ_are_named(tree):
    names = tree.write(range(3))
    change_json(tree.camera(names[2]), lambda value: value["intrinsic"].update(fx=71.0))
    assert (
        fault(tree) == f"{tree.camera(names[2])}: differs from {names[0]}_camera.json; a sequence has one calibration"
    )


@pytest.mark.parametrize("step_ns", [0, -1])
def test_time_that_does_not_grow_is_named(tree, step_ns):
    names = tree.write(range(4))
    before = int(tree.timestamp(names[1]).read_text())
    tree.timestamp(names[2]).write_text(str(before + step_ns))
    expected = f"{before + step_ns} ns is not after the frame before, {before} ns"
    assert fault(tree) == f"{tree.timestamp(names[2])}: {expected}"


@pytest.mark.parametrize("text", ["", "1.5", "-3", "soon", "9" * 40, "٣"])
def test_text_that_is_not_a_time_stamp_is_named(tree, text):
    names = tree.write(range(2))
    tree.timestamp(names[1]).write_text(text)
    assert fault(tree).startswith(f"{tree.timestamp(names[1])}: ")
    assert "is not a time stamp in integer nanoseconds" in fault(tree)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda value: value["intrinsic"].pop("fx"), "intrinsic.fx: is missing"),
        (lambda value: value.pop("extrinsic"), "extrinsic.baseline: is missing"),
        (lambda value: value.update(extrinsic=[1]), "extrinsic.baseline: is missing"),
        (lambda value: value["extrinsic"].update(pitch=float("nan")), "extrinsic.pitch: nan is not a finite number"),
        (lambda value: value["extrinsic"].update(z="high"), "extrinsic.z: 'high' is not a number"),
        (lambda value: value["intrinsic"].update(v0=True), "intrinsic.v0: 'True' is not a number"),
        (lambda value: value["intrinsic"].update(fx=-1), "intrinsic.fx: -1.0 is not positive"),
        (lambda value: value["extrinsic"].update(baseline=0), "extrinsic.baseline: 0.0 is not positive"),
    ],
)
def test_fault_in_a_camera_file_names_file_and_field(tree, change, expected):
    (name,) = tree.write([0])
    change_json(tree.camera(name), change)
    assert fault(tree) == f"{tree.camera(name)}: {expected}"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda value: value.pop("speed"), "speed: is missing"),
        (lambda value: value.update(yawRate=float("inf")), "yawRate: inf is not a finite number"),
        (lambda value: value.update(gpsLatitude=float("nan")), "gpsLatitude: nan is not a finite number"),
        (lambda value: value.update(speed=None), "speed: 'None' is not a number"),
    ],
)
def test_fault_in_a_vehicle_file_names_file_and_field(tree, change, expected):
    names = tree.write(range(2))
    change_json(tree.vehicle(names[1]), change)
    assert fault(tree) == f"{tree.vehicle(names[1])}: {expected}"


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "[" * 100_000, "\xff"])
def test_broken_json_is_named(tree, text):
    names = tree.write(range(2))
    tree.vehicle(names[1]).write_bytes(text.encode("latin-1"))
    assert fault(tree).startswith(f"{tree.vehicle(names[1])}: is no")


def test_whole_number_too_large_for_any_field_is_named(tree):
    (name,) = tree.write([0])
    tree.vehicle(name).write_text(json.dumps({"speed": 10**400, "yawRate": 0}))
    assert fault(tree).startswith(f"{tree.vehicle(name)}: speed: ")


@pytest.mark.parametrize(
    ("channel", "picture", "expected"),
    [
        ("disparity", np.zeros((32, 64), np.uint8), "is 64 x 32, 8 bit, gray; 16 bit gray is needed"),
        ("disparity", np.zeros((32, 64, 3), np.uint16), "is 64 x 32, 16 bit, colour; 16 bit gray is needed"),
        ("disparity", np.zeros((16, 32), np.uint16), "is 32 x 16, but the sequence began with 64 x 32"),
        ("image", np.zeros((32, 64, 3), np.uint16), "is 64 x 32, 16 bit, colour; 8 bit is needed"),
        ("image", np.zeros((33, 64, 3), np.uint8), "is 64 x 33, but the sequence began with 64 x 32"),
        ("gt", np.zeros((32, 64), np.uint16), "is 64 x 32, 16 bit, gray; ids of at most 8 bits are needed"),
        ("gt", np.zeros((32, 64, 3), np.uint8), "is 64 x 32, 8 bit, colour; ids of at most 8 bits are needed"),
        ("gt", np.zeros((32, 65), np.uint8), "is 65 x 32, but the sequence began with 64 x 32"),
    ],
)
def test_picture_of_another_size_or_depth_is_named(tree, channel, picture, expected):
    names = tree.write(range(3))
    path = getattr(tree, channel)(names[1])
    put(path, cv2.imencode(".png", picture)[1].tobytes())
    assert fault(tree).startswith(f"{path}: {expected}")


def test_damaged_picture_is_named(tree):
    names = tree.write(range(3))
    data = tree.disparity(names[1]).read_bytes()
    tree.disparity(names[1]).write_bytes(data[: len(data) // 2])
    assert fault(tree) == f"{tree.disparity(names[1])}: is a damaged PNG file: it ends early"


def test_tree_without_sequences_split_or_labels_is_refused(tree, tmp_path):
    with pytest.raises(InputError, match=r"src/leftImg8bit_sequence: is not a folder"):
        sequences(tree)
    (tree.root / "leftImg8bit_sequence" / "val").mkdir(parents=True)
    with pytest.raises(InputError, match="holds no <split>/<city>/"):
        sequences(tree)
    tree.write([0])
    with pytest.raises(InputError, match="train: is not a split of this tree; it has: val"):
        sequences(tree, split=("train",))
    with pytest.raises(InputError, match="labels: is not a folder of label images"):
        sequences(tree, labels=tmp_path / "labels")
    with pytest.raises(InputError, match="camera name: 'a/b' is not a name"):
        sequences(tree, camera_name="a/b")


@pytest.mark.parametrize("channel", ["vehicle", "image", "disparity"])
def test_a_file_of_a_tebibyte_is_refused_before_it_is_read(tree, channel):
    (name,) = tree.write([0])
    path = getattr(tree, channel)(name)
    os.truncate(path, 1 << 40)
    assert fault(tree) == f"{path}: has 1048576 MiB, and 256 are allowed"


def test_speed_that_no_vehicle_has_names_file_and_field(tree):
    names = tree.write(range(2))
    change_json(tree.vehicle(names[1]), lambda value: value.update(speed=1e6))
    assert fault(tree) == f"{tree.vehicle(names[1])}: speed: 1e+06 m/s is not within -15 to 70"


def test_an_image_without_all_its_pixels_is_named(tree):
    (name,) = tree.write([0])
    whole = tree.disparity(name).read_bytes()
    start = whole.index(b"IDAT") - 4
    body = whole[start + 8 : whole.index(b"IEND") - 8][:-6]
    chunk = b"IDAT" + body
    tree.disparity(name).write_bytes(
        whole[:start] + struct.pack(">I", len(body)) + chunk + struct.pack(">I", zlib.crc32(chunk)) + whole[-12:]
    )
    assert fault(tree).startswith(f"{tree.disparity(name)}: is a damaged PNG file: ")
