"""Reversed order: the newest input comes where a model expects the oldest."""

from dataclasses import replace
from typing import Literal

import torch
from pydantic import Field

from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs, in_windows


class ReversedOrder(Disturbance):
    """Inputs come newest first in a share `strength` of the windows, drawn one by one.

    Each grid keeps its time and its way to the target: it is moved into the right place, but taken for another one.
    """

    kind: Literal["reversed_order"] = "reversed_order"
    strength: float = Field(1.0, gt=0, le=1)

    @property
    def words(self) -> str:
        """Say what is wrong."""
        return f"inputs in reversed order{in_windows(self.strength)}"

    def check(self, inputs: int, sensors: tuple[str, ...]) -> None:
        """Refuse what has no order."""
        if inputs < 2:
            raise ValueError("disturb.kind: one input has no order that could be reversed")

    def apply(self, inputs: Inputs) -> Inputs:
        """Reverse all that belongs to the inputs of the chosen windows."""
        chosen = torch.from_numpy(inputs.drawn(self.strength, self.seed)).to(inputs.grids.device)
        return replace(
            inputs,
            grids=torch.where(chosen[:, None, None, None, None], inputs.grids.flip(2), inputs.grids),
            shift_cells=torch.where(chosen[:, None, None], inputs.shift_cells.flip(1), inputs.shift_cells),
            lead_s=torch.where(chosen[:, None], inputs.lead_s.flip(1), inputs.lead_s),
        )
