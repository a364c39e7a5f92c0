"""Late inputs: what arrives was seen some frames before the time that it is stamped with."""

from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from pydantic import Field

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs
from semgrid_eval.windows.disturb.turning import turn_grids


class LateInput(Disturbance):
    """Each input was seen `strength` frames before its stamp, and is placed as if it had been seen at its stamp.

    So it is turned by the heading and moved by the way of the stamp's time, and it is told to be as old as its stamp.
    Where a recording had not begun, nothing has arrived yet: the input is unknown.
    """

    kind: Literal["late_input"] = "late_input"
    strength: int = Field(1, ge=1, le=1000)

    @property
    def words(self) -> str:
        """Say what is wrong."""
        return f"inputs {self.strength} frame{'s' if self.strength > 1 else ''} late"

    def apply(self, inputs: Inputs) -> Inputs:
        """Take earlier grids, turned by how the vehicle turned since."""
        data, device = inputs.data, inputs.grids.device
        first = data.first_frames[data.locate(inputs.target_frames)[0]][:, None]
        seen = np.maximum(inputs.frames - self.strength, first)
        grids = data.grids[inputs.sensor_rows[None, :, None], torch.from_numpy(seen).to(device)[:, None, :]]
        turned = turn_grids(grids, data.yaw_rad[inputs.frames] - data.yaw_rad[seen], inputs.spec)
        absent = torch.from_numpy(inputs.frames - self.strength < first).to(device)
        return replace(inputs, grids=turned.masked_fill(absent[:, None, :, None, None], UNKNOWN))
