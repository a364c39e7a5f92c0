"""Grids moved by the ego motion (T2), and the mask M of what that leaves unknown."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.classes import UNKNOWN


def shift_in_cells(moved_m: NDArray[np.float64], cell_m: float) -> NDArray[np.int64]:
    """Round the way of the ego vehicle (..., 2: forward, left) to the cells (rows, columns) that content moves by.

    Driving forward brings content nearer (down the rows); driving left moves it right (up the columns).
    """
    return np.rint(moved_m / cell_m).astype(np.int64)


def shift_grids(grids: Tensor, shift_cells: Tensor) -> Tensor:
    """Move content by whole cells (T2): (..., H, W) by (..., 2) rows and columns -> (..., H, W).

    What leaves the grid is lost, and cells that enter it are unknown.
    """
    rows, columns = grids.shape[-2:]
    source_row = torch.arange(rows, device=grids.device) - shift_cells[..., 0:1]  # (..., H)
    source_column = torch.arange(columns, device=grids.device) - shift_cells[..., 1:2]  # (..., W)
    inside = _within(source_row, rows)[..., :, None] & _within(source_column, columns)[..., None, :]
    source = source_row.clamp(0, rows - 1)[..., :, None] * columns + source_column.clamp(0, columns - 1)[..., None, :]
    flat = grids.flatten(-2)
    moved = flat.gather(-1, source.flatten(-2).expand(flat.shape)).reshape(grids.shape)
    return torch.where(inside, moved, UNKNOWN)


def covered_without_truth(aligned: Tensor, target: Tensor) -> Tensor:
    """Compute the mask M: aligned (B, S, T, H, W) and target (B, H, W) -> (B, H, W) bool.

    The paper's M = M_covered - M_target; the target's own cells of M_covered cancel out.
    """
    return (aligned != UNKNOWN).flatten(1, 2).any(dim=1) & (target == UNKNOWN)


def _within(index: Tensor, size: int) -> Tensor:
    return (index >= 0) & (index < size)
