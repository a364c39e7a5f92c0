"""Disparity of a rectified stereo pair, by OpenCV's semi-global matching along three paths."""

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.recording.colour import decode_colour
from semgrid_eval.recording.types import CameraCalibration

NEAREST_M = 3.0
"""What is nearer than this is not matched."""
_BLOCK_PX = 5
_SUBPIXELS = 16


class SemiGlobalMatching:
    """Matches the pairs of one camera; the left `margin_px` columns, which the right camera hardly sees, stay blank."""

    def __init__(self, calibration: CameraCalibration) -> None:
        farthest_px = calibration.depth_disparity_m_px / NEAREST_M
        self.margin_px = 16 * math.ceil(farthest_px / 16)
        self._matching = cv2.StereoSGBM.create(
            minDisparity=0,
            numDisparities=self.margin_px,
            blockSize=_BLOCK_PX,
            P1=8 * _BLOCK_PX**2,
            P2=32 * _BLOCK_PX**2,
            disp12MaxDiff=1,
            uniquenessRatio=8,
            speckleWindowSize=60,
            speckleRange=2,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def disparity_px(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Match two grey images (H, W) and return the disparity (H, W); 0 where there is none."""
        found = self._matching.compute(left, right)
        return np.maximum(found, 0).astype(np.float32) / np.float32(_SUBPIXELS)


def grey_of(data: bytes, path: Path) -> NDArray[np.uint8]:
    """Decode an image, colour or grey, as a grey one (H, W); `path` is where it comes from."""
    return np.asarray(cv2.cvtColor(decode_colour(data, path), cv2.COLOR_RGB2GRAY), np.uint8)
