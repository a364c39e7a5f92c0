"""The left colour camera of KITTI: its calibration, and disparity by matching its images with the right ones."""

from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.geometry import SE3, Floats
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.disparity import coded_disparity
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.kitti.files import Calibration, read_file
from semgrid_eval.sources.matching import SemiGlobalMatching, grey_of


def left_camera(given: Calibration, ego_from_camera0: SE3, *, with_disparity: bool) -> CameraCalibration:
    """Return the calibration of the left colour camera; all of KITTI's are rectified to the axes of camera 0.

    Raises:
        InputError: a projection is missing or impossible.
    """
    projection = given.left
    left_m = _place_m(projection, given.path, "P2")
    baseline_m = _place_m(given.right, given.path, "P3")[0] - left_m[0] if with_disparity else None
    ego_from_optical = SE3(ego_from_camera0.rotation, ego_from_camera0.apply(left_m))
    with located(path=given.path):
        return CameraCalibration.of(projection, ego_from_optical, baseline_m)


def _place_m(projection: Floats, path: Path, name: str) -> Floats:
    """Return where the camera of a projection is in the axes of camera 0: (3, 4) -> (3,)."""
    try:
        return np.asarray(np.linalg.solve(projection[:, :3], -projection[:, 3]), np.float64)
    except np.linalg.LinAlgError as error:
        raise InputError("is not a projection", path=path, field=name) from error


class LeftCamera:
    """Makes frames of images, PNG files whose bytes the log keeps; with a baseline, of pairs."""

    def __init__(self, calibration: CameraCalibration) -> None:
        self._matching = None if calibration.baseline_m is None else SemiGlobalMatching(calibration)

    def frame(self, stamp_ns: int, left: Path, right: Path) -> CameraFrame:
        """Read the image of a time, and match it with the right one where there is disparity.

        Raises:
            InputError: an image is missing or damaged, or their sizes differ.
        """
        if self._matching is None:
            return CameraFrame(stamp_ns, image_file=read_file(left), disparity_png=None, label_png=None)
        files = [read_file(path) for path in (left, right)]
        grey = [grey_of(data, path) for data, path in zip(files, (left, right), strict=True)]
        if grey[0].shape != grey[1].shape:
            sizes = [ImageSize(*each.shape[::-1]) for each in grey]
            raise InputError(f"is {sizes[1]}, but the left image is {sizes[0]}", path=right)
        matched = self._matching.disparity_px(*grey)
        return CameraFrame(stamp_ns, files[0], encode_gray(coded_disparity(matched)), None)
