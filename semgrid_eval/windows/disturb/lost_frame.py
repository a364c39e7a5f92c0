"""Lost frames: nothing arrived of some inputs, so that all of their cells are unknown."""

from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from pydantic import Field

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs
from semgrid_eval.words import plural


class LostFrame(Disturbance):
    """Input frames are wholly unknown, for all sensors alike; `strength` is how many."""

    kind: Literal["lost_frame"] = "lost_frame"
    strength: int = Field(1, ge=1)
    which: Literal["newest", "oldest", "random"] = "newest"  # `random` draws them for each window

    @property
    def words(self) -> str:
        """Say what is wrong."""
        count = f"{self.strength} " if self.strength > 1 else ""
        return f"{self.which} {count}input{'s' if self.strength > 1 else ''} lost"

    def check(self, inputs: int, sensors: tuple[str, ...]) -> None:
        """Refuse to lose more than there is."""
        if self.strength > inputs:
            raise ValueError(
                f"disturb.strength: {plural(self.strength, 'frame')} cannot be lost of {plural(inputs, 'input')}"
            )

    def apply(self, inputs: Inputs) -> Inputs:
        """Make the chosen inputs unknown."""
        lost = torch.from_numpy(self._lost(inputs)).to(inputs.grids.device)
        return replace(inputs, grids=inputs.grids.masked_fill(lost[:, None, :, None, None], UNKNOWN))

    def _lost(self, inputs: Inputs) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """Choose the inputs: (B, T)."""
        windows, count = inputs.frames.shape
        order = np.tile(np.arange(count), (windows, 1))  # (B, T) oldest first
        if self.which == "newest":
            order = order[:, ::-1]
        elif self.which == "random":
            order = np.stack([generator.permutation(count) for generator in inputs.generators(self.seed)])
        lost = np.zeros((windows, count), np.bool_)
        np.put_along_axis(lost, order[:, : self.strength], values=True, axis=1)
        return lost
