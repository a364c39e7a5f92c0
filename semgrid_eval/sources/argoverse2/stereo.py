"""The stereo camera of a log: its calibration, rectified images, and disparity by matching them.

The two cameras are turned against each other by a fraction of a degree, which rectification undoes.
"""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.geometry import SE3, Floats
from semgrid_eval.recording.disparity import coded_disparity
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.argoverse2.cameras import Camera, Look, calibration_files, read_camera
from semgrid_eval.sources.argoverse2.pairs import LEFT, RIGHT, Pair
from semgrid_eval.sources.matching import SemiGlobalMatching, grey_of
from semgrid_eval.sources.rectification import Rectification, baseline_m

CAMERA = LEFT
"""Name in logs of the rectified left camera."""
OPTION = "--stereo-every"
_NO_LENS = np.zeros(5)
_ALL_SEEN = 0.0  # OpenCV's alpha: the rectified image shows only what the raw one shows


class StereoCamera:
    """Makes frames of the pairs of one log."""

    def __init__(self, log: Path) -> None:
        """Read the calibration.

        Raises:
            InputError: a file, a camera in it or a column is missing, or a value is impossible.
        """
        intrinsics, place = calibration_files(log)
        left, right = (read_camera(log, name, OPTION) for name in (LEFT, RIGHT))
        if left.size_px != right.size_px:
            fault = f"{RIGHT} is {right.size_px}, but {LEFT} is {left.size_px}"
            raise InputError(fault, path=intrinsics, field="width_px, height_px")
        right_from_left = right.ego_from_optical.inverse() @ left.ego_from_optical
        with located(path=place):
            turns, projections = _rectified(left, right, right_from_left)
            rectified = SE3(left.ego_from_optical.rotation @ turns[0].T, left.ego_from_optical.translation_m)
            self.calibration = CameraCalibration.of(projections[0], rectified, baseline_m(*projections))
        self._cameras = left, right
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
            each.apply(grey_of(camera.read_image(path), path), "bilinear")
            for each, camera, path in zip(self._rectifications, self._cameras, (pair.left, pair.right), strict=True)
        )
        matched = coded_disparity(self._matching.disparity_px(left, right))
        return CameraFrame(pair.stamp_ns, encode_gray(left), encode_gray(matched), None)


def stereo_look(log: Path, pairs: Iterable[Pair]) -> Look:
    """Return what the camera sees in pairs of a log; errors as `StereoCamera`."""
    camera = StereoCamera(log)
    return Look(camera.calibration, {pair.stamp_ns: partial(camera.frame, pair) for pair in pairs})


def _rectified(left: Camera, right: Camera, right_from_left: SE3) -> tuple[list[Floats], list[Floats]]:
    """Return the turns (3, 3) of both cameras to common axes, and their projections P (3, 4) there."""
    flags = cv2.CALIB_ZERO_DISPARITY  # equal principal points: what is infinitely far has no disparity
    lenses = left.matrix, _NO_LENS, right.matrix, _NO_LENS
    turn, shift_m = right_from_left.rotation, right_from_left.translation_m[:, np.newaxis]  # (3, 1)
    found = cv2.stereoRectify(*lenses, left.size_px, turn, shift_m, flags=flags, alpha=_ALL_SEEN)
    turns, projections = ([np.asarray(each, np.float64) for each in part] for part in (found[:2], found[2:4]))
    return turns, projections
