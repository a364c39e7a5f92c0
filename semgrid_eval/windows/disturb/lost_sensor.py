"""Lost sensors: nothing arrived of some sensors, so that all of their cells are unknown."""

from dataclasses import replace
from typing import Literal

import numpy as np
import torch
from pydantic import Field

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.faults import not_one_of
from semgrid_eval.windows.disturb.disturbance import Disturbance, Inputs, in_windows


class LostSensor(Disturbance):
    """All input frames of some sensors are unknown in a share `strength` of the windows, drawn one by one."""

    kind: Literal["lost_sensor"] = "lost_sensor"
    strength: float = Field(1.0, gt=0, le=1)
    sensors: tuple[str, ...] = Field(min_length=1)  # that are lost together, of those of the row

    @property
    def words(self) -> str:
        """Say what is wrong."""
        *others, last = self.sensors
        return f"{', '.join(others)}{' and ' * bool(others)}{last} lost{in_windows(self.strength)}"

    def check(self, inputs: int, sensors: tuple[str, ...]) -> None:
        """Refuse to lose what the row does not have."""
        for name in self.sensors:
            if name not in sensors:
                raise ValueError(f"disturb.sensors: {not_one_of(name, sensors)}")

    def apply(self, inputs: Inputs) -> Inputs:
        """Make the chosen sensors unknown."""
        windows = inputs.drawn(self.strength, self.seed)
        sensors = [inputs.data.sensors[row] in self.sensors for row in inputs.sensor_rows.tolist()]
        lost = torch.from_numpy(np.outer(windows, sensors)).to(inputs.grids.device)
        return replace(inputs, grids=inputs.grids.masked_fill(lost[:, :, None, None, None], UNKNOWN))
