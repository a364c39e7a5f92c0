"""Discretisation D: labelled points to cells by priority, and class-wise morphology (readings 12 and 13)."""

import math
from collections.abc import Iterable, Sequence

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import NO_POINT, UNKNOWN, ClassSet
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.sensors.sensor import Morphology, Points

Cells = NDArray[np.uint8]
Counts = NDArray[np.int32]


def no_points(config: GridConfig) -> Counts:
    """Return counts (C, rows, columns) of no point, to add some to."""
    return np.zeros(config.layers_shape, np.int32)


def add_points(counts: Counts, points: Points, grid_from_points: SE2, spec: GridSpec) -> None:
    """Move points into the grid (T1) and add them to the counts (C, rows, columns) of their classes and cells.

    `grid_from_points` is from the vehicle frame at the points' time to the grid's axes around the vehicle: the turn by
    its heading, and the way driven since.
    """
    move = grid_from_points
    _count(
        np.atleast_2d(points.forward_m),
        np.atleast_2d(points.left_m),
        np.atleast_2d(points.class_id),
        (math.cos(move.yaw_rad), math.sin(move.yaw_rad), move.x_m, move.y_m),
        (spec.cell_m, spec.agent_row, spec.agent_column),
        counts,
    )


def grid_of(seen: Iterable[tuple[Points, SE2]], config: GridConfig) -> Cells:
    """Make a grid (H, W) of what sensors of a configuration saw, each moved as `add_points` says.

    Points of all are counted together. Morphology is each sensor's own: the cells of those that share one are filtered
    together, and what is left of all is merged by the rule of `rasterise`.
    """
    parts: dict[Morphology, Counts] = {}
    for points, grid_from_points in seen:
        counts = parts.setdefault(config.morphology_of(points.sensor), no_points(config))
        add_points(counts, points, grid_from_points, config.spec)
    if len(parts) == 1:
        ((morphology, counts),) = parts.items()
        return rasterise(counts, config.classes, morphology)
    total = sum(parts.values(), no_points(config))
    layers = np.zeros(total.shape, np.bool_)
    for morphology, counts in parts.items():
        layers |= _layers(counts, config.classes, morphology)
    merged: Cells = _strongest(total, layers, config.classes.priorities())
    return merged


def rasterise(counts: Counts, classes: ClassSet, morphology: Morphology = "minkowski") -> Cells:
    """Decide the class of each cell: (C, H, W) point counts -> (H, W) class ids.

    The class of highest priority wins, then the one with more points, then the lower id. Morphology works on each
    class alone; its results are merged by the same rule.
    """
    grid: Cells = _strongest(counts, _layers(counts, classes, morphology), classes.priorities())
    return grid


def _layers(counts: Counts, classes: ClassSet, morphology: Morphology) -> NDArray[np.bool_]:
    """Tell for each class which cells are its own, after morphology: (C, H, W) -> (C, H, W).

    Kernels are cells at every size of cell: on a grid of half the cell size the closing bridges gaps of half the
    length, and the opening removes what is half as wide. So grids of different cell sizes are filtered differently in
    metres.
    """
    if morphology == "off":
        return np.asarray(counts > 0)
    grid: Cells = _strongest(counts, counts > 0, classes.priorities())
    layers = np.zeros(counts.shape, np.bool_)
    for class_id in np.unique(grid):
        if class_id != UNKNOWN:
            sides = classes.kernels_cells(int(class_id))
            layers[class_id] = _filter_class((grid == class_id).astype(np.uint8), sides, morphology)
    return layers


def _filter_class(layer: Cells, sides: Sequence[int], morphology: Morphology) -> NDArray[np.bool_]:
    for operation, size in zip((cv2.dilate, cv2.erode, cv2.erode, cv2.dilate), sides, strict=True):
        if size == 1:
            continue
        # OpenCV reads the kernel at anchor k // 2 in both operations. A Minkowski dilation needs its reflection,
        # which for even sizes has another anchor; without it an opening shifts by a cell.
        anchor = size - 1 - size // 2 if operation is cv2.dilate and morphology == "minkowski" else size // 2
        layer = operation(layer, np.ones((size, size), np.uint8), anchor=(anchor, anchor)).astype(np.uint8, copy=False)
    return layer.astype(np.bool_)


@numba.njit(cache=True, nogil=True)
def _count(forward_m, left_m, class_id, move, extent, counts):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    cosine, sine, way_forward_m, way_left_m = move
    cell_m, agent_row, agent_column = extent
    rows, columns = counts.shape[1], counts.shape[2]
    for v in range(class_id.shape[0]):
        for u in range(class_id.shape[1]):
            label = class_id[v, u]
            if label == NO_POINT:
                continue
            ahead_m = cosine * forward_m[v, u] - sine * left_m[v, u] + way_forward_m
            aside_m = sine * forward_m[v, u] + cosine * left_m[v, u] + way_left_m
            row = agent_row - 1 - np.floor(ahead_m / cell_m)
            column = agent_column - 1 - np.floor(aside_m / cell_m)
            if 0 <= row < rows and 0 <= column < columns:
                counts[label, int(row), int(column)] += 1


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
