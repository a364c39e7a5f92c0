"""Bad Cityscapes trees: single files, pictures, and what is missing or too much."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from support.bad.case import Bad, Kind, lines, table
from support.bad.json_files import BROKEN, changed
from support.cityscapes_tree import CAMERA, Tree, put

from semgrid_eval.recording.png import encode_gray

CONVERT = "convert cityscapes SRC logs --workers 1"
PNGS = Path(__file__).parents[2] / "corpus" / "png"
TREE = Tree(Path("SRC"), size=(16, 8))
FIRST, SECOND, LAST = (TREE.name(number) for number in range(3))
VEHICLE = {"speed": 5.5, "yawRate": 0.1, "gpsLatitude": 49.1, "gpsLongitude": 8.2, "gpsHeading": None}


def whole() -> None:
    """Write a tree of three frames, and a folder of label images."""
    tree = Tree(Path("SRC"), size=(16, 8))
    for name in tree.write(range(3)):
        put(Path("labels", f"{name}_labelIds.png"), tree.label())


VEHICLES = r"""
speed: (gone)
speed: fast
speed: null
speed: true
speed: [5]
speed: 1000000.0
speed: -20
speed: .nan
yawRate: (gone)
yawRate: .inf
yawRate: 7.5
yawRate: "0.1"
gpsLatitude: north
gpsLatitude: .nan
gpsLongitude: [8.2]
gpsHeading: west
"""
CAMERAS = r"""
intrinsic: (gone)
intrinsic: 3
intrinsic: {fx: (gone)}
intrinsic: {fx: -1.0}
intrinsic: {fx: "70"}
intrinsic: {fy: 0}
intrinsic: {u0: null}
intrinsic: {v0: true}
extrinsic: (gone)
extrinsic: {baseline: (gone)}
extrinsic: {baseline: 0}
extrinsic: {x: forward}
extrinsic: {z: .inf}
extrinsic: {pitch: .nan}
extrinsic: {yaw: [0.1]}
"""
STAMPS = {
    "nothing": b"",
    "a decimal number": b"1.5",
    "a negative number": b"-3",
    "a word": b"soon",
    "40 digits": b"9" * 40,
    "an Arabic digit": "٣".encode(),
    "two numbers": b"1 2",
    "a time before the frame before": b"1",
}
VEHICLE_BYTES = BROKEN | {line: changed(VEHICLE, line) for line in lines(VEHICLES)}
CAMERA_BYTES = BROKEN | {line: changed(CAMERA, line) for line in lines(CAMERAS)}
PNG_WORDS = {
    "bomb": "pixels that grow to gigabytes",
    "checksum": "a wrong checksum of the pixels",
    "checksum_cut": "no checksum of the pixels",
    "compression": "an unknown compression",
    "cut": "pixels that end early",
    "depth_of_colour": "a bit depth that its colours cannot have",
    "empty": "nothing",
    "filter": "a line with an unknown filter",
    "gif": "a GIF file",
    "interlace_kind": "an unknown interlacing",
    "interlace_too_short": "interlacing without all its pixels",
    "junk": "pixels that are not compressed",
    "line_missing": "a line too few",
    "more_pixels": "a line too many",
    "no_pixels": "a width of 0",
    "signature": "the signature alone",
    "too_large": "more pixels than are allowed",
    "two_headers": "two headers",
}
_GOOD = encode_gray(np.zeros((8, 16), np.uint8))
PNG_BYTES = {words: (PNGS / f"{name}.png").read_bytes() for name, words in PNG_WORDS.items()} | {
    "a wrong checksum of its header": _GOOD[:29] + b"\0\0\0\0" + _GOOD[33:],
    "no header": _GOOD[:8] + _GOOD[33:],
    "only a header": _GOOD[:33],
}


def _picture(*shape: int, kind: type = np.uint8) -> bytes:
    return cv2.imencode(".png", np.ones(shape, kind))[1].tobytes()


def _tree(words: str, spoil: Callable[[], object], command: str = CONVERT) -> Bad:
    return Bad(words, command, spoil=spoil)


def _is(words: str, path: Path, content: bytes, command: str = CONVERT) -> Bad:
    return Bad(words, command, {str(path): content})


def _move_images() -> None:
    for image in TREE.image(FIRST).parent.glob("*.png"):
        image.rename(image.with_name(image.name.replace("leftImg8bit", "right")))


LABEL, LABELLED = Path("labels", f"{FIRST}_labelIds.png"), f"{CONVERT} --labels labels"
IDS = encode_gray(np.full((8, 16), 33, np.uint8))
OTHER_CAMERA = changed(CAMERA, "extrinsic: {z: 2}")
TREES = (
    _tree("no folder leftImg8bit_sequence", lambda: shutil.rmtree("SRC/leftImg8bit_sequence")),
    _tree("no image in it", _move_images),
    _tree("a frame lost in the middle", lambda: TREE.image(SECOND).unlink()),
    _tree("no disparity of a frame", lambda: TREE.disparity(SECOND).unlink()),
    _tree("no vehicle file of a frame", lambda: TREE.vehicle(SECOND).unlink()),
    _tree("no time stamp of a frame", lambda: TREE.timestamp(SECOND).unlink()),
    _tree("no camera file at all", lambda: shutil.rmtree("SRC/camera")),
    _tree("a folder where a vehicle file is expected", lambda: _to_folder(TREE.vehicle(FIRST))),
    _is("camera files that differ", TREE.camera(LAST), OTHER_CAMERA),
    _is("a colour image of another size", TREE.image(LAST), _picture(9, 16, 3)),
    _is("a colour image of 16 bit", TREE.image(FIRST), _picture(8, 16, 3, kind=np.uint16)),
    _is("a disparity image of another size", TREE.disparity(LAST), _picture(8, 17, kind=np.uint16)),
    _is("a disparity image of 8 bit", TREE.disparity(FIRST), _picture(8, 16)),
    _is("a disparity image in colour", TREE.disparity(FIRST), _picture(8, 16, 3, kind=np.uint16)),
    _tree("no such split", lambda: None, f"{CONVERT} --split vla"),
    _tree("a name of a camera with a space", lambda: None, f"{CONVERT} --camera-name 'front left'"),
    _tree("labels: a folder without one for these frames", lambda: Path("none").mkdir(), f"{CONVERT} --labels none"),
    _tree("labels: a file", lambda: Path("one.png").touch(), f"{CONVERT} --labels one.png"),
    _tree("labels: two images of a frame", lambda: _two_labels(), LABELLED),
    _tree("labels: named as train ids", lambda: _rename_labels("labelTrainIds"), LABELLED),
    _tree("labels: named as label ids, and --train-ids", lambda: None, f"{LABELLED} --train-ids"),
    Bad(
        "labels: train ids that are label ids",
        f"{LABELLED} --train-ids",
        {str(LABEL): IDS},
        lambda: _rename_labels("x"),
    ),
    _is("labels: of another size", LABEL, _picture(4, 8), LABELLED),
    _is("labels: of 16 bit", LABEL, _picture(8, 16, kind=np.uint16), LABELLED),
    _is("labels: in colour", LABEL, _picture(8, 16, 3), LABELLED),
    _is("labels: not a picture", LABEL, b"road", LABELLED),
)


def _to_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _two_labels() -> None:
    shutil.copy(LABEL, LABEL.with_name(f"{FIRST}_again_labelIds.png"))


def _rename_labels(kind: str) -> None:
    for label in Path("labels").iterdir():
        label.rename(label.with_name(label.name.replace("labelIds", kind)))


KINDS = (
    Kind(
        "Cityscapes: vehicle files",
        "What a `*_vehicle.json` has otherwise than a good one; `(gone)` means that a field is missing.",
        whole,
        table(CONVERT, str(TREE.vehicle(FIRST)), VEHICLE_BYTES),
    ),
    Kind(
        "Cityscapes: camera files",
        "What a `*_camera.json` has otherwise than a good one; `(gone)` means that a field is missing.",
        whole,
        table(CONVERT, str(TREE.camera(FIRST)), CAMERA_BYTES),
    ),
    Kind(
        "Cityscapes: time stamps",
        "What a `*_timestamp.txt` holds.",
        whole,
        table(CONVERT, str(TREE.timestamp(SECOND)), STAMPS),
    ),
    Kind("Cityscapes: trees", f"The tree of `{CONVERT}`.", whole, TREES),
    Kind("PNG", "A colour image of a tree.", whole, table(CONVERT, str(TREE.image(FIRST)), PNG_BYTES)),
)
