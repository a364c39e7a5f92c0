"""Grids that are turned about the vehicle, as a wrong heading turns them."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.windows.grids import cells_before_turn, take_cells


def turn_grids(grids: Tensor, angle_rad: NDArray[np.float64], spec: GridSpec) -> Tensor:
    """Turn content about the vehicle, counterclockwise seen from above: (B, S, T, H, W) by (B, T) -> (B, S, T, H, W).

    What comes from outside the grid is unknown.
    """
    pivot, size = (spec.agent_row - 0.5, spec.agent_column - 0.5), (spec.rows, spec.columns)
    angles = torch.from_numpy(angle_rad).to(grids.device)
    # One window after the other: places of cells are much larger than the cells.
    return torch.stack(
        [
            take_cells(window, *cells_before_turn(angle.cos(), angle.sin(), pivot, size))
            for window, angle in zip(grids, angles, strict=True)
        ]
    )
