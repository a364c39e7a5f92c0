"""Discretisation D: labelled points to cells by priority, and class-wise morphology (readings 12 and 13)."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, CLASSES, NO_POINT, UNKNOWN, Category, priorities
from semgrid_eval.grids.geometry import GroundRays
from semgrid_eval.grids.spec import GridSpec

Cells = NDArray[np.uint8]
Counts = NDArray[np.int32]
Morphology = Literal["minkowski", "opencv", "off"]

STATIC_KERNELS = (3, 2, 4, 4)
OTHER_KERNELS = (1, 1, 2, 2)
"""Sizes of dilation, erosion, erosion, dilation (supplement, "semantic grid generation")."""

_PRIORITIES = priorities()


@dataclass(frozen=True)
class LabelledImage:
    """What one frame contributes: grid classes and disparity at the resized resolution.

    Args:
        classes: (H, W) uint8 grid class ids, `NO_POINT` where there is no point.
        disparity: (H, W) uint16, d_px = (p - 1) / 256, 0 invalid.
    """

    classes: Cells
    disparity: NDArray[np.uint16]


def count_points(
    image: LabelledImage, rays: GroundRays, yaw_rad: float, crops: NDArray[np.int64], spec: GridSpec
) -> Counts:
    """Project all pixels (P), turn them by the vehicle's heading (T1) and count them by sensor, class and cell.

    Args:
        image: labels and disparity.
        rays: of the same camera and size.
        yaw_rad: heading of the vehicle in the orientation of the grid, left-positive.
        crops: (S, 4) top, bottom, left, right of each sensor in pixels, end exclusive.
        spec: extent of the grid.

    Returns:
        (S, C, rows, columns) number of points.
    """
    counts = np.zeros((len(crops), CLASS_COUNT, spec.rows, spec.columns), np.int32)
    _count(
        image.classes,
        image.disparity,
        rays.slope,
        rays.origin_m,
        rays.depth_disparity_m_px,
        np.array([np.cos(yaw_rad), np.sin(yaw_rad)]),
        crops,
        (spec.cell_m, spec.agent_row, spec.agent_column),
        counts,
    )
    return counts


def rasterise(counts: Counts, morphology: Morphology = "minkowski") -> Cells:
    """Decide the class of each cell: (C, H, W) point counts -> (H, W) class ids.

    The class of highest priority wins, then the one with more points, then the lower id. Morphology works on each
    class alone; its results are merged by the same rule.
    """
    grid: Cells = _strongest(counts, counts > 0, _PRIORITIES)
    if morphology == "off":
        return grid
    layers = np.zeros(counts.shape, np.bool_)
    for class_id in np.unique(grid):
        if class_id != UNKNOWN:
            layers[class_id] = _filter_class((grid == class_id).astype(np.uint8), int(class_id), morphology)
    merged: Cells = _strongest(counts, layers, _PRIORITIES)
    return merged


def _filter_class(layer: Cells, class_id: int, morphology: Morphology) -> NDArray[np.bool_]:
    sizes = STATIC_KERNELS if CLASSES[class_id].category is Category.STATIC else OTHER_KERNELS
    for operation, size in zip((cv2.dilate, cv2.erode, cv2.erode, cv2.dilate), sizes, strict=True):
        if size == 1:
            continue
        # OpenCV reads the kernel at anchor k // 2 in both operations. A Minkowski dilation needs its reflection,
        # which for even sizes has another anchor; without it an opening shifts by a cell.
        anchor = size - 1 - size // 2 if operation is cv2.dilate and morphology == "minkowski" else size // 2
        layer = operation(layer, np.ones((size, size), np.uint8), anchor=(anchor, anchor)).astype(np.uint8, copy=False)
    return layer.astype(np.bool_)


@numba.njit(cache=True, nogil=True)
def _count(classes, disparity, slope, origin_m, depth_disparity, heading, crops, extent, counts):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    cell_m, agent_row, agent_column = extent
    rows, columns = counts.shape[2], counts.shape[3]
    for v in range(classes.shape[0]):
        for u in range(classes.shape[1]):
            label = classes[v, u]
            value = disparity[v, u]
            if label == NO_POINT or value <= 1:  # 0 is invalid, 1 is at infinity
                continue
            depth_m = depth_disparity * 256.0 / (value - 1.0)
            forward_m = origin_m[0] + depth_m * slope[0, v, u]
            left_m = origin_m[1] + depth_m * slope[1, v, u]
            row = agent_row - 1 - np.floor((heading[0] * forward_m - heading[1] * left_m) / cell_m)
            column = agent_column - 1 - np.floor((heading[1] * forward_m + heading[0] * left_m) / cell_m)
            if row < 0 or row >= rows or column < 0 or column >= columns:
                continue
            for s in range(crops.shape[0]):
                if crops[s, 0] <= v < crops[s, 1] and crops[s, 2] <= u < crops[s, 3]:
                    counts[s, label, int(row), int(column)] += 1


@numba.njit(cache=True, nogil=True)
def _strongest(counts, present, priority):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    classes, rows, columns = counts.shape
    grid = np.zeros((rows, columns), np.uint8)
    for row in range(rows):
        for column in range(columns):
            best_rank = np.int64(-1)
            for label in range(1, classes):  # 0 is unknown: what remains where nothing is present
                rank = (np.int64(priority[label]) << 40) + counts[label, row, column]
                if present[label, row, column] and rank > best_rank:
                    best_rank = rank
                    grid[row, column] = label
    return grid
