"""Read single files of a Cityscapes tree.

What is missing, broken or impossible in one is an InputError that names the file and, where there is one, the field.
"""

import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.faults import shown
from semgrid_eval.files import read_bytes, read_json
from semgrid_eval.labels import CITYSCAPES_LABELS, label_ids_from_train_ids
from semgrid_eval.motion import implausible
from semgrid_eval.recording.png import GRAY, PALETTE, PngHeader, decode_ids, encode_gray, require_pixels
from semgrid_eval.recording.types import CameraCalibration, MotionSample

MAX_FILE_BYTES = 1 << 28
_LAST_STAMP_NS = (1 << 63) - 1
# A calibration's fields are Cityscapes' with their unit: fx_px is `intrinsic.fx`, roll_rad `extrinsic.roll`.
_CAMERA_FIELDS = {
    entry.name: ("intrinsic" if entry.name.endswith("_px") else "extrinsic", entry.name.rpartition("_")[0])
    for entry in fields(CameraCalibration)
}
_MOTION_FIELDS = {"speed_mps": "speed", "yaw_rate_radps": "yawRate"}
_GPS_FIELDS = {"latitude_deg": "gpsLatitude", "longitude_deg": "gpsLongitude", "heading_deg": "gpsHeading"}


def read_file(path: Path) -> bytes:
    """Read a whole file of at most 256 MiB."""
    return read_bytes(path, limit=MAX_FILE_BYTES)


def read_camera(path: Path) -> CameraCalibration:
    """Read `*_camera.json`."""
    content = _read_object(path)
    values = {name: _number(content, path, *place) for name, place in _CAMERA_FIELDS.items()}
    try:
        return CameraCalibration(**values)
    except InputError as error:
        field = error.field or ""
        message = str(error).removeprefix(f"{field}: ")
        raise InputError(message, path=path, field=".".join(_CAMERA_FIELDS[field])) from error


def read_vehicle(path: Path, stamp_ns: int) -> MotionSample:
    """Read `*_vehicle.json`, which holds for the time of its frame; GPS fields may be absent or null."""
    content = _read_object(path)
    motion = {name: _number(content, path, field) for name, field in _MOTION_FIELDS.items()}
    given = {name: field for name, field in _GPS_FIELDS.items() if content.get(field) is not None}
    gps = {name: _number(content, path, field) for name, field in given.items()}
    sample = MotionSample(stamp_ns=stamp_ns, **motion, **gps)
    if fault := implausible(sample):
        raise InputError(fault[1], path=path, field=_MOTION_FIELDS[fault[0]])
    return sample


def read_stamp(path: Path) -> int:
    """Read `*_timestamp.txt`: integer nanoseconds."""
    text = read_file(path).strip()
    if not text.isdigit() or len(text) > 19 or int(text) > _LAST_STAMP_NS:
        shown = text[:40].decode(errors="replace")
        raise InputError(f"{shown!r} is not a time stamp in integer nanoseconds", path=path)
    return int(text)


def read_picture(path: Path, bit_depth: int, *, gray: bool) -> tuple[bytes, PngHeader]:
    """Read a PNG file of a bit depth undecoded, with its header."""
    data = read_file(path)
    header = require_pixels(data, path)
    if header.bit_depth != bit_depth or (gray and header.colour_type != GRAY):
        raise InputError(f"is {header}; {bit_depth} bit{' gray' if gray else ''} is needed", path=path)
    return data, header


def read_label(path: Path, *, train_ids: bool) -> tuple[bytes, PngHeader]:
    """Read a label image as an 8-bit PNG file of label ids, gray or palette; label ids of 8 bits stay undecoded."""
    data = read_file(path)
    header = require_pixels(data, path)
    if header.bit_depth == 8 and header.colour_type in (GRAY, PALETTE) and not train_ids:
        return data, header
    ids = decode_ids(data, path)
    if train_ids:
        known = [label.train_id for label in CITYSCAPES_LABELS]  # 255, which stands for none, among them
        strange = np.setdiff1d(ids, known)
        if len(strange):
            raise InputError(f"holds {strange[0]}, which is not a train id; are these label ids?", path=path)
        ids = label_ids_from_train_ids()[ids]
    return encode_gray(ids), header


def _read_object(path: Path) -> dict[str, Any]:
    content = read_json(path, limit=MAX_FILE_BYTES)
    if not isinstance(content, dict):
        raise InputError("is not a JSON object", path=path)
    return content


def _number(content: dict[str, Any], path: Path, *place: str) -> float:
    """Return the finite number at a place in nested objects."""
    field = ".".join(place)
    value: Any = content
    for key in place:
        if not isinstance(value, dict) or key not in value:
            raise InputError("is missing", path=path, field=field)
        value = value[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{shown(value)} is not a number", path=path, field=field)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{number} is not a finite number", path=path, field=field)
    return number
