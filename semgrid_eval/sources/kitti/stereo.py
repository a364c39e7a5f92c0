"""The left colour camera of KITTI: its calibration, and disparity by matching its images with the right ones."""

from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.geometry import SE3
from semgrid_eval.recording.disparity import coded_disparity
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame
from semgrid_eval.sources.kitti.files import Calibration, read_file
from semgrid_eval.sources.matching import SemiGlobalMatching, grey_of


def calibration_of(given: Calibration, ego_from_camera0: SE3, path: Path, *, with_disparity: bool) -> CameraCalibration:
    """Return the left colour camera's; all cameras of KITTI are rectified to the axes of camera 0.

    Raises:
        InputError: a value is impossible, in the file `path`.
    """
    projection = given.left
    fx_px, fy_px, u0_px, v0_px = (float(projection[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    try:
        camera_m = np.linalg.solve(projection[:, :3], -projection[:, 3])  # of its place in the axes of camera 0
        right_m = np.linalg.solve(given.right[:, :3], -given.right[:, 3])
    except np.linalg.LinAlgError as error:
        raise InputError("is not a projection", path=path, field="P2, P3") from error
    x_m, y_m, z_m = ego_from_camera0.apply(np.asarray(camera_m, np.float64)).tolist()
    baseline_m = float(right_m[0] - camera_m[0]) if with_disparity else None
    with located(path=path):
        return CameraCalibration(fx_px, fy_px, u0_px, v0_px, baseline_m, x_m, y_m, z_m, 0.0, 0.0, 0.0)


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
            sizes = [f"{each.shape[1]} x {each.shape[0]}" for each in grey]
            raise InputError(f"is {sizes[1]}, but the left image is {sizes[0]}", path=right)
        matched = self._matching.disparity_px(*grey)
        return CameraFrame(stamp_ns, files[0], encode_gray(coded_disparity(matched)), None)
