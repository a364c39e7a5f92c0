"""Grids that are turned about the vehicle, as a wrong heading turns them."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.spec import GridSpec


def turn_grids(grids: Tensor, angle_rad: NDArray[np.float64], spec: GridSpec) -> Tensor:
    """Turn content about the vehicle, counterclockwise seen from above: (B, S, T, H, W) by (B, T) -> (B, S, T, H, W).

    A cell takes what was where its middle comes from; what comes from outside the grid is unknown.
    """
    angles = torch.from_numpy(angle_rad).to(grids.device)
    return torch.stack([_turned(window, angle, spec) for window, angle in zip(grids, angles, strict=True)])


def _turned(grids: Tensor, angle_rad: Tensor, spec: GridSpec) -> Tensor:
    """Turn the inputs of one window: (S, T, H, W) by (T,) -> (S, T, H, W)."""
    forward_m, left_m = (torch.from_numpy(axis).to(grids.device) for axis in spec.centres_m())
    cosine, sine = angle_rad.cos()[:, None, None], angle_rad.sin()[:, None, None]
    from_forward_m = cosine * forward_m[:, None] + sine * left_m  # (T, H, W)
    from_left_m = cosine * left_m - sine * forward_m[:, None]
    row = (spec.agent_row - from_forward_m / spec.cell_m).floor().long()
    column = (spec.agent_column - from_left_m / spec.cell_m).floor().long()
    inside = (row >= 0) & (row < spec.rows) & (column >= 0) & (column < spec.columns)
    source = (row.clamp(0, spec.rows - 1) * spec.columns + column.clamp(0, spec.columns - 1)).flatten(-2)
    turned = grids.flatten(-2).gather(-1, source.expand(*grids.shape[:2], -1)).reshape(grids.shape)
    return torch.where(inside, turned, UNKNOWN)
