"""The stereo camera of a log: its calibration, rectified images, and disparity by matching them.

Images of Argoverse are published undistorted; `k1`, `k2`, `k3` of its intrinsics tell what the lens was, and are not
read. The two cameras are turned against each other by a fraction of a degree, which rectification undoes.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import read_bytes
from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, SE3, Floats, roll_pitch_yaw_of
from semgrid_eval.recording.colour import ImageSize, read_size
from semgrid_eval.recording.disparity import coded_disparity
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.argoverse2.pairs import LEFT, RIGHT, Pair
from semgrid_eval.sources.argoverse2.tables import MAX_FILE_BYTES, Table, read_table
from semgrid_eval.sources.argoverse2.tracks import POSE, transform
from semgrid_eval.sources.argoverse2.vehicle import EGO_FROM_ARGOVERSE
from semgrid_eval.sources.matching import SemiGlobalMatching, grey_of
from semgrid_eval.sources.rectification import Rectification, baseline_m

CAMERA = LEFT
"""Name in logs of the rectified left camera."""
_LENS = ("fx_px", "fy_px", "cx_px", "cy_px")
_INTRINSICS = {
    "sensor_name": "string",
    **dict.fromkeys(_LENS, "float64"),
    **dict.fromkeys(("width_px", "height_px"), "int64"),
}
_NO_LENS = np.zeros(5)
_ALL_SEEN = 0.0  # OpenCV's alpha: the rectified image shows only what the raw one shows


@dataclass(frozen=True, eq=False)
class _Camera:
    matrix: Floats  # (3, 3)
    size_px: ImageSize
    ego_from_optical: SE3


def calibration_files(log: Path) -> tuple[Path, Path]:
    """Return the files of a log that say how the cameras see, and where they are."""
    return log / "calibration" / "intrinsics.feather", log / "calibration" / "egovehicle_SE3_sensor.feather"


class StereoCamera:
    """Makes frames of the pairs of one log."""

    def __init__(self, log: Path) -> None:
        """Read the calibration.

        Raises:
            InputError: a file, a camera in it or a column is missing, or a value is impossible.
        """
        self._intrinsics, place = calibration_files(log)
        left, right = (_read_camera(name, self._intrinsics, place) for name in (LEFT, RIGHT))
        if left.size_px != right.size_px:
            fault = f"{RIGHT} is {_told(right.size_px)}, but {LEFT} is {_told(left.size_px)}"
            raise InputError(fault, path=self._intrinsics, field="width_px, height_px")
        self._size_px = left.size_px
        right_from_left = right.ego_from_optical.inverse() @ left.ego_from_optical
        with located(path=place):
            turns, projections = _rectified(left, right, right_from_left)
            self.calibration = _calibration(left, turns[0], projections)
        self._rectifications = [
            Rectification(cv2.initUndistortRectifyMap(each.matrix, _NO_LENS, turn, p, left.size_px, cv2.CV_32FC1))
            for each, turn, p in zip((left, right), turns, projections, strict=True)
        ]
        self._matching = SemiGlobalMatching(self.calibration)

    def frame(self, pair: Pair) -> CameraFrame:
        """Read, rectify and match a pair.

        Raises:
            InputError: an image is missing, damaged or of another size than the calibration.
        """
        left, right = (
            each.apply(self._grey(path), "bilinear")
            for each, path in zip(self._rectifications, (pair.left, pair.right), strict=True)
        )
        matched = coded_disparity(self._matching.disparity_px(left, right))
        return CameraFrame(pair.stamp_ns, encode_gray(left), encode_gray(matched), None)

    def _grey(self, path: Path) -> NDArray[np.uint8]:
        data = read_bytes(path, limit=MAX_FILE_BYTES)
        size_px = read_size(data, path)
        if size_px != self._size_px:
            known = f"{self._intrinsics.name} calibrates {_told(self._size_px)}"
            raise InputError(f"is {_told(size_px)}, but {known}", path=path)
        return grey_of(data, path)


def _read_camera(name: str, intrinsics: Path, places: Path) -> _Camera:
    table = read_table(intrinsics, _INTRINSICS)
    row = _row(table, name, intrinsics)
    fx_px, fy_px, u0_px, v0_px = (float(table[each][row]) for each in _LENS)
    for field, value in (("fx_px", fx_px), ("fy_px", fy_px)):
        if value <= 0:
            raise InputError(f"row {row}: {value:g} is not positive", path=intrinsics, field=field)
    size_px = ImageSize(int(table["width_px"][row]), int(table["height_px"][row]))
    matrix = np.array([[fx_px, 0.0, u0_px], [0.0, fy_px, v0_px], [0.0, 0.0, 1.0]])
    table = read_table(places, {"sensor_name": "string", **POSE})
    argoverse_from_optical = transform(table, _row(table, name, places), places)
    return _Camera(matrix, size_px, EGO_FROM_ARGOVERSE @ argoverse_from_optical)


def _row(table: Table, name: str, path: Path) -> int:
    rows = np.flatnonzero(table["sensor_name"] == name)
    if len(rows) != 1:
        fault = f"has {len(rows)} rows of {name}; one is needed (--stereo-every 0 leaves images out)"
        raise InputError(fault, path=path, field="sensor_name")
    return int(rows[0])


def _rectified(left: _Camera, right: _Camera, right_from_left: SE3) -> tuple[list[Floats], list[Floats]]:
    """Return the turns (3, 3) of both cameras to common axes, and their projections P (3, 4) there."""
    flags = cv2.CALIB_ZERO_DISPARITY  # equal principal points: what is infinitely far has no disparity
    lenses = left.matrix, _NO_LENS, right.matrix, _NO_LENS
    turn, shift_m = right_from_left.rotation, right_from_left.translation_m[:, np.newaxis]  # (3, 1)
    found = cv2.stereoRectify(*lenses, left.size_px, turn, shift_m, flags=flags, alpha=_ALL_SEEN)
    turns, projections = ([np.asarray(each, np.float64) for each in part] for part in (found[:2], found[2:4]))
    return turns, projections


def _calibration(left: _Camera, turn: Floats, projections: list[Floats]) -> CameraCalibration:
    """Return the calibration of the left camera after its turn (3, 3)."""
    rectified = SE3(left.ego_from_optical.rotation @ turn.T, left.ego_from_optical.translation_m)
    ego_from_camera = rectified @ CAMERA_FROM_OPTICAL.inverse()
    fx_px, fy_px, u0_px, v0_px = (float(projections[0][place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    x_m, y_m, z_m = ego_from_camera.translation_m.tolist()
    angles_rad = roll_pitch_yaw_of(ego_from_camera.rotation)
    return CameraCalibration(fx_px, fy_px, u0_px, v0_px, baseline_m(*projections), x_m, y_m, z_m, *angles_rad)


def _told(size_px: ImageSize) -> str:
    return f"{size_px.width} x {size_px.height}"
