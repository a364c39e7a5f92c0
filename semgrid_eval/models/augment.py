"""Augmentation of training batches: scenes are mirrored and turned as a whole, inputs moved off their place."""

import math
from dataclasses import replace

import torch
from pydantic import Field
from torch import Tensor

from semgrid_eval.config import Config
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.windows.grids import cells_before_turn, covered_without_truth, shift_grids, take_cells


class AugmentConfig(Config):
    """What is done to a batch before the network trains on it; by default nothing."""

    flip: float = Field(default=0.0, ge=0.0, le=1.0)  # share of the windows that are mirrored, left for right
    rotate_deg: float = Field(default=0.0, ge=0.0, le=45.0)  # a window is turned by up to this much to either side
    misalign_cells: int = Field(default=0, ge=0, le=16)  # an input is moved by up to this much along rows and columns


def augment(batch: WindowBatch, config: AugmentConfig, generator: torch.Generator, *, translate: bool) -> WindowBatch:
    """Change a batch by chance: inputs, target, shifts and M stay consistent, on the device where they are.

    Args:
        batch: what the network would see.
        config: what is done to it; with the default nothing is drawn.
        generator: draws on the CPU, so that devices agree.
        translate: whether the batch's inputs are moved into the target's place already.
    """
    if config == AugmentConfig():
        return batch
    windows, inputs = batch.lead_s.shape
    if config.flip:
        batch = flipped(batch, torch.rand(windows, generator=generator) < config.flip)
    if config.rotate_deg:
        share = 2.0 * torch.rand(windows, generator=generator, dtype=torch.float64) - 1.0
        batch = rotated(batch, share * math.radians(config.rotate_deg))
    if config.misalign_cells:
        most = config.misalign_cells
        batch = misaligned(batch, torch.randint(-most, most + 1, (windows, inputs, 2), generator=generator))
    return replace(batch, mask=covered_without_truth(batch.aligned(translate=translate), batch.target))


def flipped(batch: WindowBatch, chosen: Tensor) -> WindowBatch:
    """Mirror the chosen windows (B,) left for right; M is left as it was."""
    chosen = chosen.to(batch.target.device, non_blocking=True)
    past = torch.where(chosen[:, None, None, None, None], batch.past.flip(-1), batch.past)
    target = torch.where(chosen[:, None, None], batch.target.flip(-1), batch.target)
    sign = torch.stack([torch.ones_like(chosen, dtype=torch.int64), 1 - 2 * chosen.long()], dim=-1)
    return replace(batch, past=past, target=target, shift_cells=batch.shift_cells * sign[:, None])


def rotated(batch: WindowBatch, angle_rad: Tensor) -> WindowBatch:
    """Turn windows, each by its angle (B,), to the left about the middle of the grid's lower edge; M is left as it was.

    There the paper's grid has the vehicle. What comes from outside the grid is unknown.
    """
    device = batch.target.device
    cos, sin = (each.float().to(device, non_blocking=True) for each in (angle_rad.cos(), angle_rad.sin()))
    rows, columns = batch.target.shape[-2:]
    row, column = cells_before_turn(cos, sin, (rows - 0.5, columns / 2.0 - 0.5), (rows, columns))
    row_shift, column_shift = batch.shift_cells.float().unbind(-1)  # (B, T) each
    cos, sin = cos[:, None], sin[:, None]
    turned = torch.stack([cos * row_shift - sin * column_shift, sin * row_shift + cos * column_shift], dim=-1)
    return replace(
        batch,
        past=take_cells(batch.past, row[:, None, None], column[:, None, None]),
        target=take_cells(batch.target, row, column),
        shift_cells=turned.round().long(),
    )


def misaligned(batch: WindowBatch, moved_cells: Tensor) -> WindowBatch:
    """Move each input by whole cells (B, T, 2) down and right, and nothing else; M is left as it was.

    That is what errors of the egomotion do: `shift_cells` stay what was reported. Sensors move together.
    """
    moved_cells = moved_cells.to(batch.past.device, non_blocking=True)
    return replace(batch, past=shift_grids(batch.past, moved_cells[:, None]))
