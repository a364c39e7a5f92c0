"""Disparity as logs code it: 16 bit, d_px = (p - 1) / 256, p = 0 is invalid."""

import numpy as np
from numpy.typing import NDArray

CODING_ERROR_PX = 1 / 512
"""Rounding changes no disparity by more than half a step of the coding."""
LARGEST_PX = (65535 - 1) / 256
"""What is larger cannot be coded, and becomes invalid."""
_Float32s = NDArray[np.float32]


def coded_disparity(disparity_px: _Float32s) -> NDArray[np.uint16]:
    """Code disparities (H, W) as Cityscapes does: p = 256 d + 1, and 0 for what is not positive or too large."""
    coded = np.rint(disparity_px * np.float32(256.0)) + np.float32(1.0)
    return np.where((disparity_px > 0.0) & (coded <= 65535.0), coded, 0.0).astype(np.uint16)


def decoded_disparity(coded: NDArray[np.uint16]) -> _Float32s:
    """Decode disparities (H, W); what is invalid, and what is at infinity, is 0."""
    return np.asarray(np.maximum(coded.astype(np.float32) - 1.0, 0.0) / 256.0, np.float32)
