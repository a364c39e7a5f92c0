"""BL-Fuse with true motion: what motion alone is worth, without knowing what no input shows."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.actor_motion import ActorMotion
from semgrid_eval.models.model import Given, Model, one_hot
from semgrid_eval.models.overlay import newest_first, overlay
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.windows.grids import shift_grids

Grid = NDArray[np.uint8]


class FuseTrueMotion(Model):
    """All inputs overlaid as BL-Fuse does, after each actor's cells are moved by its true motion to the target's time.

    What an actor leaves behind is unknown, unless another input shows it.
    """

    words = "all inputs overlaid, each actor's cells moved by its true motion"
    family = "Truth"
    files = ()

    @classmethod
    def asks(cls, settings: Any, given: Given) -> ActorMotion:  # noqa: ANN401 - none
        """Ask for the motion of what its inputs show."""
        return ActorMotion(given.sensors)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the overlay as certain scores: (B, C, H, W)."""
        assert batch.truth is not None
        motion_m = batch.truth.float().movedim(-1, 0)  # (2, B, S, T, H, W)
        if self.given.translate:
            motion_m = shift_grids(motion_m, batch.shift_cells[:, None])
        way_cells = (-motion_m / self.given.cell_m).round().long().movedim(0, -1).cpu().numpy()
        past = batch.past.cpu().numpy()
        moved = np.stack([moved_by(past[at], way_cells[at]) for at in np.ndindex(past.shape[:3])]).reshape(past.shape)
        return one_hot(overlay(newest_first(replace(batch, past=torch.from_numpy(moved).to(batch.past.device)))))


def moved_by(grid: Grid, way_cells: NDArray[np.int64]) -> Grid:
    """Move cells by whole rows and columns: (H, W) by (H, W, 2) -> (H, W); places that are left become unknown."""
    start = np.argwhere(way_cells.any(axis=-1))
    end = start + way_cells[tuple(start.T)]
    inside = ((end >= 0) & (end < grid.shape)).all(axis=1)
    result = grid.copy()
    result[tuple(start.T)] = UNKNOWN
    result[tuple(end[inside].T)] = grid[tuple(start[inside].T)]
    return result
