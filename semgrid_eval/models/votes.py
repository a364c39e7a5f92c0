"""What most draws of a target say."""

from torch import Tensor

from semgrid_eval.classes import UNKNOWN


def likeliest(votes: Tensor) -> Tensor:
    """Turn votes of draws into scores, the shares of the draws: (B, C, H, W) uint8 -> (B, C, H, W) float32.

    Where most draws know a cell, so does the answer: unknown has no share there.
    """
    shares = votes.float() / votes.sum(dim=1, keepdim=True)
    shares[:, UNKNOWN].masked_fill_(shares[:, UNKNOWN] < 0.5, 0.0)
    return shares
