"""Calibrations of cameras: what CameraInfo says, and how raw images are rectified."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.sources.rectification import Maps, Rectification

_LENSES = ("", "plumb_bob", "rational_polynomial")
_FISHEYE = ("equidistant", "fisheye")


@dataclass(frozen=True)
class Info:
    """What a CameraInfo says."""

    width: int
    height: int
    model: str
    d: tuple[float, ...]
    k: tuple[float, ...]  # (9,)
    r: tuple[float, ...]  # (9,)
    p: tuple[float, ...]  # (12,)

    @classmethod
    def of(cls, message: Any) -> "Info":  # noqa: ANN401 - a class that rosbags makes
        """Take what matters out of a message."""
        numbers = {name: tuple(float(each) for each in getattr(message, name)) for name in "dkrp"}
        return cls(message.width, message.height, message.distortion_model, **numbers)

    def projection(self, *, rectified: bool) -> NDArray[np.float64]:
        """Return P (3, 4) of the rectified image.

        Raises:
            InputError: the camera is not calibrated, or is said to be rectified and P is not known.
        """
        if self.p[0] > 0:
            return np.array(self.p).reshape(3, 4)
        if not self.k[0] > 0:
            raise InputError("is not a calibration: K and P are zero")
        if rectified and any(self.d):
            raise InputError("has distortion and no P, so the image is not rectified: set rectified: false")
        return np.hstack([np.array(self.k).reshape(3, 3), np.zeros((3, 1))])


def rectification_of(info: Info, *, rectified: bool) -> Rectification:
    """Return what undoes the distortion of a camera's raw images, and leaves those alone that have none.

    Raises:
        InputError: the lens is not one of those that OpenCV knows.
    """
    return Rectification(None if rectified else _maps(info))


def _maps(info: Info) -> Maps | None:
    """Return where each pixel of the rectified image is in the raw one, None where that is the same place."""
    projection = info.projection(rectified=False)[:, :3]
    camera, lens = np.array(info.k).reshape(3, 3), np.array(info.d)
    turn = np.array(info.r).reshape(3, 3) if any(info.r) else np.eye(3)
    if not lens.any() and np.array_equal(turn, np.eye(3)) and np.array_equal(camera, projection):
        return None
    size = (info.width, info.height)
    if info.model in _LENSES:
        return cv2.initUndistortRectifyMap(camera, lens, turn, projection, size, cv2.CV_32FC1)
    if info.model in _FISHEYE:
        return cv2.fisheye.initUndistortRectifyMap(camera, lens[:4], turn, projection, size, cv2.CV_32FC1)
    known = ", ".join((*_LENSES[1:], _FISHEYE[0]))
    raise InputError(f"its lens is {info.model!r}; known are {known}; rectify the images, or record rectified ones")
