"""A sweep as a picture all around the LiDAR: the label of what is nearest, by azimuth and elevation."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.labels import label_palette
from semgrid_eval.recording.lidar import LidarSweep
from semgrid_eval.recording.png import encode_gray, with_palette

WIDTH_PX, HEIGHT_PX = 256, 64
TOP_RAD, BOTTOM_RAD = np.deg2rad((16.0, -28.0))
"""Elevations of the upper and the lower edge, between which rotating LiDARs of cars look."""


def panorama(sweep: LidarSweep) -> NDArray[np.uint8]:
    """Return label ids (H, W) of a sweep that has labels, 0 where there is no point.

    Directions are those of the LiDAR's own axes: ahead is the middle column, behind both edges, left is left. Columns
    are equal steps of azimuth, rows of elevation; a pixel without a point shows that of the one above it, which closes
    the gaps between rings.
    """
    assert sweep.label_id is not None
    x_m, y_m, z_m = sweep.points_m.astype(np.float64).T
    across_m = np.hypot(x_m, y_m)
    column = ((0.5 - np.arctan2(y_m, x_m) / (2 * np.pi)) * WIDTH_PX).astype(np.intp) % WIDTH_PX
    row = np.floor((TOP_RAD - np.arctan2(z_m, across_m)) / (TOP_RAD - BOTTOM_RAD) * HEIGHT_PX).astype(np.intp)
    inside = np.flatnonzero((row >= 0) & (row < HEIGHT_PX))
    farthest_first = inside[np.argsort(-across_m[inside], kind="stable")]
    shown = np.zeros((HEIGHT_PX, WIDTH_PX), np.uint8)
    shown[row[farthest_first], column[farthest_first]] = sweep.label_id[farthest_first]
    shown[1:] = np.where(shown[1:] == 0, shown[:-1], shown[1:])
    return shown


def panorama_png(sweep: LidarSweep) -> bytes:
    """Return the panorama of a sweep that has labels as a palette PNG."""
    shown = panorama(sweep)
    return with_palette(encode_gray(shown), label_palette()[: int(shown.max()) + 1])
