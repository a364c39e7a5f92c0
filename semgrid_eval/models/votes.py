"""What most draws of a target say."""

from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.windows.grids import shift_grids


def likeliest(votes: Tensor, seen: Tensor | None = None) -> Tensor:
    """Turn votes of draws into scores, the shares of the draws: (B, C, H, W) uint8 -> (B, C, H, W) float32.

    Where most draws know a cell, so does the answer: unknown has no share there. Likewise where a cell was `seen`
    (B, H, W) and any draw knows it.
    """
    shares = votes.float() / votes.sum(dim=1, keepdim=True)
    unknown = shares[:, UNKNOWN]
    unknown.masked_fill_(unknown < 0.5, 0.0)
    if seen is not None:
        unknown.masked_fill_(seen & (unknown < 1.0), 0.0)
    return shares


def seen_cells(batch: WindowBatch, *, translate: bool) -> Tensor:
    """Tell which cells an input knows, moved into the target's place: (B, H, W) bool."""
    aligned = batch.past if translate else shift_grids(batch.past, batch.shift_cells[:, None])
    return (aligned != UNKNOWN).flatten(1, 2).any(dim=1)
