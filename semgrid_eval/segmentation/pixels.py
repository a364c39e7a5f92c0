"""What goes into a segmentation network and what comes out of it, in pixels: sizes, levels, the best class."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.resizing import Size, nearest


def network_input(
    picture: NDArray[np.uint8], size: Size, mean: Sequence[float], std: Sequence[float]
) -> NDArray[np.float32]:
    """Scale an RGB picture to a size (bilinear) and normalise it: (H, W, 3) -> (1, 3, h, w)."""
    if size != size_of(picture):
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR), np.uint8)
    levels = np.arange(256) / 255
    result = np.empty((1, 3, *picture.shape[:2]), np.float32)
    for channel in range(3):
        table = ((levels - mean[channel]) / std[channel]).astype(np.float32)
        np.take(table, picture[..., channel], out=result[0, channel])
    return result


def best_class(scores: NDArray[np.floating], size: Size, *, smooth: bool) -> NDArray[np.uint8]:
    """Resize scores and take the class of the highest, the first of equal ones: (C, h, w) -> (H, W).

    One class, of at most 256, is scaled at a time, so that the scores of all at full size are never in memory. Smooth
    scores are interpolated (bilinear, by the centres of pixels); otherwise the nearest is taken.
    """
    smooth = smooth and size != size_of(scores[0])
    best = _plane(scores[0], size, smooth=smooth)
    ids = np.zeros(best.shape, np.uint8)
    for number in range(1, len(scores)):
        plane = _plane(scores[number], size, smooth=smooth)
        ids[plane > best] = number
        np.maximum(best, plane, out=best)
    return ids if smooth else nearest(ids, size)


def size_of(picture: NDArray[np.generic]) -> Size:
    """Return width and height of a picture (H, W, ...)."""
    return picture.shape[1], picture.shape[0]


def _plane(scores: NDArray[np.floating], size: Size, *, smooth: bool) -> NDArray[np.float32]:
    plane = np.array(scores, np.float32, order="C")
    return np.asarray(cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR)) if smooth else plane
