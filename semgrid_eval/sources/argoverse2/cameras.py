"""Cameras of a log: how each sees, where it is, and its images, each a file named by its time.

Images of Argoverse are published undistorted; `k1`, `k2`, `k3` of its intrinsics tell what the lens was, and are not
read.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_bytes
from semgrid_eval.geometry import SE3, Floats
from semgrid_eval.recording.colour import ImageSize, read_size
from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.argoverse2.tables import MAX_FILE_BYTES, MAX_STAMP_NS, Table, read_table
from semgrid_eval.sources.argoverse2.tracks import POSE, transform
from semgrid_eval.sources.argoverse2.vehicle import EGO_FROM_ARGOVERSE

_LENS = ("fx_px", "fy_px", "cx_px", "cy_px")
_INTRINSICS = {
    "sensor_name": "string",
    **dict.fromkeys(_LENS, "float64"),
    **dict.fromkeys(("width_px", "height_px"), "int64"),
}
_STAMP = re.compile(r"[0-9]{1,19}")


Images = dict[int, Path]
"""Files by time."""


def stamped(folder: Path, pattern: str) -> dict[int, Path]:
    """Return the files of a folder whose names are times, by time."""
    named = (path for path in sorted(folder.glob(pattern)) if _STAMP.fullmatch(path.stem))
    return {stamp_ns: path for path in named if (stamp_ns := int(path.stem)) < MAX_STAMP_NS}


def cameras_folder(log: Path) -> Path:
    """Return the folder of a log that holds the folders of its cameras."""
    return log / "sensors" / "cameras"


def images_of(log: Path, camera: str) -> Images:
    """Return the images of a camera by time."""
    return stamped(cameras_folder(log) / camera, "*.jpg")


def calibration_files(log: Path) -> tuple[Path, Path]:
    """Return the files of a log that say how the cameras see, and where they are."""
    return log / "calibration" / "intrinsics.feather", log / "calibration" / "egovehicle_SE3_sensor.feather"


class Look(NamedTuple):
    """What a camera of a recording sees: its calibration, and what makes its frames, by time."""

    calibration: CameraCalibration
    frames: dict[int, Callable[[], CameraFrame]]


@dataclass(frozen=True, eq=False)
class Camera:
    """What the files of a log say of one camera."""

    matrix: Floats  # (3, 3)
    size_px: ImageSize
    ego_from_optical: SE3
    told_by: Path

    def read_image(self, path: Path) -> bytes:
        """Read an image file.

        Raises:
            InputError: it is no image, or one of another size than the calibration.
        """
        data = read_bytes(path, limit=MAX_FILE_BYTES)
        size_px = read_size(data, path)
        if size_px != self.size_px:
            raise InputError(f"is {size_px}, but {self.told_by.name} calibrates {self.size_px}", path=path)
        return data


def read_camera(log: Path, name: str, option: str) -> Camera:
    """Read what the files of a log say of a camera; `option` is what leaves its images out.

    Raises:
        InputError: a file, the camera in it or a column is missing, or a value is impossible.
    """
    intrinsics, places = calibration_files(log)
    table = read_table(intrinsics, _INTRINSICS)
    row = _row(table, name, intrinsics, option)
    fx_px, fy_px, u0_px, v0_px = (float(table[each][row]) for each in _LENS)
    for field, value in (("fx_px", fx_px), ("fy_px", fy_px)):
        if value <= 0:
            raise InputError(f"row {row}: {value:g} is not positive", path=intrinsics, field=field)
    size_px = ImageSize(int(table["width_px"][row]), int(table["height_px"][row]))
    matrix = np.array([[fx_px, 0.0, u0_px], [0.0, fy_px, v0_px], [0.0, 0.0, 1.0]])
    table = read_table(places, {"sensor_name": "string", **POSE})
    argoverse_from_optical = transform(table, _row(table, name, places, option), places)
    return Camera(matrix, size_px, EGO_FROM_ARGOVERSE @ argoverse_from_optical, intrinsics)


def _row(table: Table, name: str, path: Path, option: str) -> int:
    rows = np.flatnonzero(table["sensor_name"] == name)
    if len(rows) != 1:
        fault = f"has {len(rows)} rows of {name}; one is needed ({option} 0 leaves images out)"
        raise InputError(fault, path=path, field="sensor_name")
    return int(rows[0])
