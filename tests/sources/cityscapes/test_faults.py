"""Faults of a Cityscapes tree: each names its file."""

import json
import os
import struct
import zlib

import cv2
import numpy as np
import pytest
from support.cityscapes_tree import Tree, change_json, fault, put, sequences

from semgrid_eval.errors import InputError


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path / "src")


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
        (lambda value: value["intrinsic"].update(v0=True), "intrinsic.v0: true is not a number"),
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
        (lambda value: value.update(speed=None), "speed: null is not a number"),
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
    with pytest.raises(InputError, match="split 'train' is not val, the only choice"):
        sequences(tree, split=("train",))
    with pytest.raises(InputError, match="labels: is not a folder of label images"):
        sequences(tree, labels=tmp_path / "labels")
    with pytest.raises(InputError, match="camera_name: 'a/b' is not a name"):
        sequences(tree, camera_name="a/b")


@pytest.mark.parametrize("channel", ["vehicle", "image", "disparity"])
def test_a_file_of_a_tebibyte_is_refused_before_it_is_read(tree, channel):
    (name,) = tree.write([0])
    path = getattr(tree, channel)(name)
    os.truncate(path, 1 << 40)
    assert fault(tree) == f"{path}: has 1099511627776 bytes, and 268435456 are allowed"


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
