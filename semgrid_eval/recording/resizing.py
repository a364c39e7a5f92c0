"""Pictures brought to another size, each pixel from the one that holds its centre: ids must not be mixed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Size = tuple[int, int]
"""Width and height in pixels."""


def nearest_indices(source: int, target: int) -> NDArray[np.intp]:
    """Return, for each of `target` pixels, the nearest of `source` pixels along one axis (half-pixel centres)."""
    return (2 * np.arange(target) + 1) * source // (2 * target)


def nearest(picture: NDArray[Any], size: Size) -> NDArray[Any]:
    """Resize a picture: (h, w, ...) -> (H, W, ...)."""
    columns, rows = size
    height, width = picture.shape[:2]
    if size == (width, height):
        return picture
    return picture[nearest_indices(height, rows)[:, np.newaxis], nearest_indices(width, columns)]
