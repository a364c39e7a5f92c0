"""Mislabelled patches: squares of the inputs in which every known cell has another class."""

from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs


class Mislabelled(Disturbance):
    """Known cells in random square patches have another known class; `strength` is their expected share.

    Each input has patches of its own, the same for all of its sensors, since these are parts of one picture. In a patch
    each class is taken for one other, drawn for the patch.
    """

    kind: Literal["mislabelled"] = "mislabelled"
    strength: float = Field(0.1, gt=0, le=1)
    patch_m: float = Field(3.0, gt=0, le=100)  # side of a patch, rounded to whole cells and at least one

    @property
    def words(self) -> str:
        """Say what is wrong."""
        return f"{100 * self.strength:g}% of the cells mislabelled, in patches of {self.patch_m:g} m"

    def apply(self, inputs: Inputs) -> Inputs:
        """Change classes within patches."""
        side = max(1, round(self.patch_m / inputs.spec.cell_m))
        windows, count = inputs.frames.shape
        shape, known = (inputs.spec.rows, inputs.spec.columns), len(inputs.data.classes.known)
        steps = np.zeros((windows, count, *shape), np.uint8)
        for of_window, generator in zip(steps, inputs.generators(self.seed), strict=True):
            for of_input in of_window:
                of_input[:] = patches(generator, self.strength, side, shape, known)
        moves = torch.from_numpy(steps).to(inputs.grids.device)[:, None]
        return replace(inputs, grids=_moved_on(inputs.grids, moves, known))


def patches(
    generator: np.random.Generator, share: float, side: int, shape: tuple[int, int], known: int
) -> NDArray[np.uint8]:
    """Draw patches on a lattice at a random place: (H, W), by how many classes a cell is moved on, 0 outside.

    Of one known class alone there is no other to move on to.
    """
    blocks = [-(-length // side) + 1 for length in shape]
    steps = np.where(generator.random(blocks) < share, generator.integers(1, max(2, known), blocks), 0).astype(np.uint8)
    top, left = generator.integers(side, size=2).tolist()
    return steps.repeat(side, axis=0).repeat(side, axis=1)[top : top + shape[0], left : left + shape[1]]


def _moved_on(grids: torch.Tensor, steps: torch.Tensor, known: int) -> torch.Tensor:
    """Take for each known class the one that many ids on, after the last one the first again."""
    moved = (grids.to(torch.int16) - 1 + steps) % known + 1  # 0 is unknown
    return torch.where(grids == UNKNOWN, grids, moved.to(torch.uint8))
