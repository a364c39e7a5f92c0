"""BL-Flow: what moves fast, and on request what moves slowly, goes on as they moved between the two newest inputs.

Everything else is BL-Fuse. Motion that is not there costs more than motion that is missed: the same car seen from
another side, or one of a parked row and then its neighbour, look like motion too. So a component moves only if all the
evidence agrees.
"""

from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field
from torch import Tensor

from semgrid_eval.classes import UNKNOWN, ClassSet
from semgrid_eval.config import Config
from semgrid_eval.models.model import Baseline, one_hot
from semgrid_eval.models.overlay import overlay
from semgrid_eval.windows.data import WindowBatch

Grid = NDArray[np.uint8]
Cells = NDArray[np.int64]


class FlowSettings(Config):
    """What counts as evidence of motion; a component of cells that lacks any of it stays where BL-Fuse has it."""

    # Classes that move fast, vehicles: what is faster is taken for a mix-up of two.
    speed_limit_mps: float = Field(20.0, ge=0, le=100)
    # The same for those that move slowly, persons and bicycles. By default they stay: even a cyclist comes no farther
    # than two cells between two inputs, and moving them gained nothing on simulated towns.
    small_speed_limit_mps: float = Field(0.0, ge=0, le=100)
    least_cells: int = Field(3, ge=1)  # smaller components are taken for noise
    least_motion_cells: float = Field(2.0, gt=0)  # shorter motion is taken for rounding, of grids and of ego motion
    size_ratio: float = Field(0.5, ge=0, le=1)  # least share of the larger of two components that the smaller one has
    overlap: float = Field(0.55, ge=0, le=1)  # least intersection over union of the two shapes, one laid over the other
    # At least this share of the place that was left, and of the place that was taken, is known at the other time: what
    # comes out from behind something else has not moved.
    seen: float = Field(0.65, ge=0, le=1)
    # At most this share of the place that was left shows the class still, and of the place that was taken had shown it
    # before: a parked row of which now one car and then another is seen fails here.
    still_there: float = Field(0.1, ge=0, le=1)


class Move(NamedTuple):
    """A connected component in the older and in the newer grid: their (N, 2) cells, and the cells (2,) between them."""

    class_id: int
    older: Cells
    newer: Cells
    shift: Cells
    overlap: float


class MoveOn(Baseline):
    """BL-Flow (not in the paper)."""

    Settings = FlowSettings
    words = "all inputs overlaid, what is seen moving between the newest two moved on"

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return BL-Fuse's overlay with what moves moved on, as certain scores: (B, C, H, W)."""
        return one_hot(self.answer(batch), self.given.classes.count)

    def answer(self, batch: WindowBatch) -> Tensor:
        """Return BL-Fuse's overlay with what moves moved on: (B, H, W) uint8 class ids."""
        layers = torch.stack([overlay(grids) for grids in batch.past.flip(2).unbind(dim=2)], dim=1)  # newest first
        if layers.shape[1] < 2:
            return layers[:, 0]
        lead_s = batch.lead_s.cpu().numpy()[:, ::-1]
        result = [self._moved_on(*window) for window in zip(layers.cpu().numpy(), lead_s, strict=True)]
        return torch.from_numpy(np.stack(result)).to(layers.device)

    def _moved_on(self, layers: Grid, lead_s: NDArray[np.float32]) -> Grid:
        """Predict one window: layers (T, H, W) and their (T,) times to the target, newest first -> (H, W)."""
        gap_s = float(lead_s[1] - lead_s[0])
        classes = self.given.classes
        moves = find_moves(layers[1], layers[0], gap_s / self.given.cell_m, classes, self.settings)
        bare = layers.copy()
        for move in moves:
            bare[0][tuple(move.newer.T)] = UNKNOWN
            bare[1][tuple(move.older.T)] = UNKNOWN
        result: Grid = overlay(torch.from_numpy(bare)[None])[0].numpy().copy()
        for move in moves:
            _fill(result, move.newer, classes)
        for move in moves:
            ahead = move.newer + np.rint(move.shift * (lead_s[0] / gap_s)).astype(np.int64)
            inside = ((ahead >= 0) & (ahead < result.shape)).all(axis=1)
            result[tuple(ahead[inside].T)] = move.class_id
        return result


def find_moves(older: Grid, newer: Grid, cells_per_mps: float, classes: ClassSet, config: FlowSettings) -> list[Move]:
    """Match components of two aligned grids (H, W) that show motion, each of them once.

    `cells_per_mps` is how many cells a speed of 1 m/s makes between them.
    """
    moves: list[Move] = []
    for class_id in classes.movable:
        before, after = (_components(grid == class_id, config.least_cells) for grid in (older, newer))
        is_fast = class_id in classes.fast
        reach_cells = cells_per_mps * (config.speed_limit_mps if is_fast else config.small_speed_limit_mps)
        pairs = [_match(class_id, first, second, reach_cells, config) for first in before for second in after]
        moves += _once([move for move in pairs if move is not None and _is_motion(move, older, newer, config)])
    return moves


def _components(layer: NDArray[np.bool_], least_cells: int) -> list[Cells]:
    """List the cells (N, 2) of each connected component of a layer (H, W)."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(layer.astype(np.uint8))
    large = [label for label in range(1, count) if statistics[label, cv2.CC_STAT_AREA] >= least_cells]
    return [np.argwhere(labels == label) for label in large]


def _match(class_id: int, older: Cells, newer: Cells, reach_cells: float, config: FlowSettings) -> Move | None:
    """Find the motion between two components, None where it is too short or too long or they are too different."""
    if min(len(older), len(newer)) < config.size_ratio * max(len(older), len(newer)):
        return None
    nearly = np.rint(newer.mean(axis=0) - older.mean(axis=0)).astype(np.int64)
    if np.hypot(*nearly) > reach_cells + 2:
        return None
    shifts = [nearly + np.array([row, column]) for row in (-1, 0, 1) for column in (-1, 0, 1)]
    overlaps = [_overlap(older + shift, newer) for shift in shifts]
    best = int(np.argmax(overlaps))
    if overlaps[best] < config.overlap or not config.least_motion_cells <= np.hypot(*shifts[best]) <= reach_cells:
        return None
    return Move(class_id, older, newer, shifts[best], overlaps[best])


def _overlap(first: Cells, second: Cells) -> float:
    """Intersection over union of two sets of cells."""
    common = len(set(map(tuple, first.tolist())).intersection(map(tuple, second.tolist())))
    return common / (len(first) + len(second) - common)


def _is_motion(move: Move, older: Grid, newer: Grid, config: FlowSettings) -> bool:
    """Tell whether the place that was left has become free and the one that was taken had been free."""
    was, now = np.zeros(older.shape, np.bool_), np.zeros(older.shape, np.bool_)
    was[tuple(move.older.T)] = True
    now[tuple(move.newer.T)] = True
    left, taken = newer[was & ~now], older[now & ~was]
    if not len(left) or not len(taken):
        return False
    occupied = max(np.mean(left == move.class_id), np.mean(taken == move.class_id))
    seen = min(np.mean(left != UNKNOWN), np.mean(taken != UNKNOWN))
    return bool(occupied <= config.still_there and seen >= config.seen)


def _once(moves: list[Move]) -> list[Move]:
    """Keep the best match of each component."""
    kept: list[Move] = []
    for move in sorted(moves, key=lambda move: -move.overlap):
        if not any(move.newer is other.newer or move.older is other.older for other in kept):
            kept.append(move)
    return kept


def _fill(grid: Grid, cells: Cells, classes: ClassSet) -> None:
    """Give cells that nothing is known of the commonest class of the background around the component."""
    hidden = np.zeros(grid.shape, np.uint8)
    hidden[tuple(cells.T)] = 1
    around = (cv2.dilate(hidden, np.ones((3, 3), np.uint8)) > 0) & (hidden == 0)
    counts = np.bincount(grid[around], minlength=classes.count) * np.isin(np.arange(classes.count), classes.background)
    if counts.any():
        grid[(hidden > 0) & (grid == UNKNOWN)] = counts.argmax()
