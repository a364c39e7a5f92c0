"""The kinds of disturbances: who adds a kind adds its line to `KINDS`."""

from typing import Annotated

from pydantic import BeforeValidator, SerializeAsAny

from semgrid_eval.config import of_kind
from semgrid_eval.windows.disturb.disturbance import Disturbance
from semgrid_eval.windows.disturb.late_input import LateInput
from semgrid_eval.windows.disturb.lost_frame import LostFrame
from semgrid_eval.windows.disturb.lost_sensor import LostSensor
from semgrid_eval.windows.disturb.mislabelled import Mislabelled
from semgrid_eval.windows.disturb.reversed_order import ReversedOrder
from semgrid_eval.windows.disturb.yaw_rate_bias import YawRateBias

KINDS: dict[str, type[Disturbance]] = {
    "lost_frame": LostFrame,
    "lost_sensor": LostSensor,
    "mislabelled": Mislabelled,
    "yaw_rate_bias": YawRateBias,
    "late_input": LateInput,
    "reversed_order": ReversedOrder,
}

AnyDisturbance = SerializeAsAny[Annotated[Disturbance, BeforeValidator(lambda value: of_kind(value, KINDS))]]
"""Settings of a disturbance of any kind; `kind` tells which."""
