"""A biased yaw rate: inputs are turned about the vehicle, the more the older they are, and moved along a bent way."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import Field

from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs
from semgrid_eval.windows.disturb.turning import turn_grids
from semgrid_eval.windows.grids import shift_in_cells


class YawRateBias(Disturbance):
    """The yaw rate is `strength` too high, in degrees a second, left-positive.

    The heading is taken to be right at the target's time, whose grid stays as it is. At a time `age` before it, the
    heading was then estimated as bias * age less than it was: points seen then were turned that much to the right, and
    so was every step that was driven. Grids that are not moved (`translate: false`) are only turned.
    """

    kind: Literal["yaw_rate_bias"] = "yaw_rate_bias"
    strength: float = Field(1.0, ge=-90, le=90)

    @property
    def words(self) -> str:
        """Say what is wrong."""
        return f"yaw rate {self.strength:+g}\N{DEGREE SIGN}/s off"

    def apply(self, inputs: Inputs) -> Inputs:
        """Turn the inputs and bend the way between them and the target."""
        bias_radps = math.radians(self.strength)
        data = inputs.data
        age_ns = data.stamps_ns[inputs.target_frames][:, None] - data.stamps_ns[inputs.frames]
        angle_rad = -bias_radps * 1e-9 * age_ns.astype(np.float64)
        moved_m = np.stack(
            [
                _driven_m(inputs, frames, target, bias_radps)
                for frames, target in zip(inputs.frames, inputs.target_frames, strict=True)
            ]
        )
        return replace(
            inputs,
            grids=turn_grids(inputs.grids, angle_rad, inputs.spec),
            shift_cells=torch.from_numpy(shift_in_cells(moved_m, data.cell_m)).to(inputs.shift_cells.device),
        )


def _driven_m(inputs: Inputs, frames: NDArray[np.int64], target: np.int64, bias_radps: float) -> NDArray[np.float64]:
    """Add up the steps that one window's vehicle drove from each input to the target, each turned: -> (T, 2)."""
    first = frames[0]
    position_m, stamps_ns = inputs.data.position_m[first : target + 1], inputs.data.stamps_ns[first : target + 1]
    turn = -bias_radps * (stamps_ns[-1] - stamps_ns[:-1]) * 1e-9
    step = np.diff(position_m, axis=0) @ np.array([1.0, 1.0j])  # forward and left as a complex number
    left_to_drive = np.concatenate([np.cumsum((step * np.exp(1j * turn))[::-1])[::-1], [0.0]])[frames - first]
    return np.stack([left_to_drive.real, left_to_drive.imag], axis=1)
