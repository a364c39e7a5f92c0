"""Rectify images with OpenCV, once it is known where each pixel of the rectified image is in the raw one."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError

_INTERPOLATION = {"bilinear": cv2.INTER_LINEAR, "nearest": cv2.INTER_NEAREST}
Picture = NDArray[Any]
Maps = tuple[Picture, Picture]
"""Column and row in the raw image of each pixel of the rectified one, both (H, W), as OpenCV makes them."""


class Rectification:
    """Rectifies the raw images of a camera; without maps, leaves them alone."""

    def __init__(self, maps: Maps | None) -> None:
        self._maps = maps

    @property
    def changes(self) -> bool:
        """Whether pictures are changed."""
        return self._maps is not None

    def apply(self, picture: Picture, how: str) -> Picture:
        """Rectify a picture (H, W, ...), `bilinear` or `nearest`; what no pixel shows becomes 0."""
        if self._maps is None:
            return picture
        return np.asarray(cv2.remap(picture, *self._maps, _INTERPOLATION[how]), picture.dtype)


def baseline_m(left: NDArray[np.float64], right: NDArray[np.float64]) -> float:
    """Return how far the right camera of a rectified pair is to the right, from both P (3, 4).

    Raises:
        InputError: it is not to the right.
    """
    found = float(left[0, 3] - right[0, 3]) / float(left[0, 0])
    if not found > 0:
        raise InputError(f"P says that the right camera is {found:g} m to the right of the left one")
    return found
