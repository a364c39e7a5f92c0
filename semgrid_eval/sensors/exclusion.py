"""Pixels that are not used: near borders between classes and near steps in depth, where label and depth disagree.

The paper names both as remedies for what makes small objects vanish and come back, and did not try them.
"""

from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Image = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True)
class Exclusion:
    """Which pixels of an image are not used; by default all are."""

    border_px: int = 0  # not used is what has another class at most this many pixels away; 0 uses all
    depth_step_px: float | None = None  # what `beside_steps` finds is not used; None uses all

    def __bool__(self) -> bool:
        """Tell whether any pixel may be left out."""
        return self.border_px > 0 or self.depth_step_px is not None

    def mask(self, class_id: NDArray[np.uint8], disparity: Image, source_px: float = 1.0) -> Mask:
        """Find the pixels that are not used, from the images (H, W) of classes and of disparity -> (H, W).

        `source_px` is as for `beside_steps`.
        """
        found = near_borders(class_id, self.border_px)
        return found if self.depth_step_px is None else found | beside_steps(disparity, self.depth_step_px, source_px)


ALL_PIXELS = Exclusion()


def near_borders(class_id: NDArray[np.uint8], reach_px: int) -> Mask:
    """Find the pixels with another class at most `reach_px` rows and columns away: (H, W) -> (H, W).

    Pixels that give no point are a class of their own, so that what stands before the sky has a border; labels of one
    class have none between them, since to take one for the other changes no grid. The image's edge is not a border.
    """
    window = np.ones((2 * reach_px + 1,) * 2, np.uint8)
    differs: Mask = np.not_equal(cv2.dilate(class_id, window), cv2.erode(class_id, window))
    return differs


def beside_steps(disparity: Image, step_px: float, source_px: float = 1.0) -> Mask:
    """Find the pixels whose disparity differs by more than `step_px` from one of their eight neighbours': -> (H, W).

    Steps are measured in disparity because errors of stereo are even there, and because the disparity of a plane grows
    evenly over the image: from row to row the ground's grows by baseline / camera height, .17 px for Cityscapes' camera
    and .20 px for KITTI's, near and far alike. A step in metres or as a share of the depth that finds a car before a
    wall would leave out all of the ground from some distance on.

    Args:
        disparity: (H, W) 16 bit, d_px = (p - 1) / 256; 0 is invalid and no neighbour.
        step_px: in pixels of the image (H, W).
        source_px: pixels of the image that disparity was measured in to one of these.
    """
    found = np.zeros(disparity.shape, np.bool_)
    _mark_steps(disparity, 256.0 * source_px * step_px, found)
    return found


@numba.njit(cache=True, nogil=True)
def _mark_steps(disparity, least, found):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    height, width = disparity.shape
    for v in range(height):
        for u in range(width):
            # Each pair once: the pixel and its neighbours right of it and below.
            for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
                if v + down >= height or not 0 <= u + right < width:
                    continue
                own, other = np.int64(disparity[v, u]), np.int64(disparity[v + down, u + right])
                if own > 0 and other > 0 and abs(own - other) > least:
                    found[v, u] = found[v + down, u + right] = True
