"""What a LiDAR measures in one turn: points with labels, all at one time."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3, Quaternion, quaternion_of
from semgrid_eval.words import plural

MAX_POINTS = 1 << 22
"""Some ten times as many as any LiDAR gives in one turn."""
MAX_RANGE_M = 1000.0


@dataclass(frozen=True)
class Mount:
    """Where a sensor is in the vehicle frame, and how it is turned; the numbers are those of the log."""

    place_m: tuple[float, float, float]
    turn: Quaternion

    @classmethod
    def of(cls, ego_from_sensor: SE3) -> Self:
        """Take place and turn from a transform."""
        x_m, y_m, z_m = ego_from_sensor.translation_m.tolist()
        return cls((x_m, y_m, z_m), quaternion_of(ego_from_sensor.rotation))

    @cached_property
    def ego_from_sensor(self) -> SE3:
        """From the axes of the sensor to the vehicle frame; a ValueError says that the turn is none."""
        return SE3.from_quaternion(self.turn, self.place_m)


@dataclass(frozen=True, eq=False)
class LidarSweep:
    """One turn of a LiDAR, its points moved to where they are at one time (what many call deskewed).

    Raises:
        InputError: there are more than `MAX_POINTS` points, one is not finite or beyond `MAX_RANGE_M`, or another array
            has another length.
    """

    stamp_ns: int
    mount: Mount
    points_m: NDArray[np.float32]  # (N, 3) in the LiDAR's own frame
    intensity: NDArray[np.float32]  # (N,) as the LiDAR gives it; it has no unit
    label_id: NDArray[np.uint8] | None  # (N,) Cityscapes label ids; None where nobody has labelled the points

    def __post_init__(self) -> None:
        count = len(self.points_m)
        if count > MAX_POINTS:
            raise InputError(f"has {count} points; at most {MAX_POINTS} are allowed")
        for values, what in ((self.label_id, ("label",)), (self.intensity, ("intensity", "intensities"))):
            if values is not None and len(values) != count:
                raise InputError(f"has {plural(len(values), *what)} for {plural(count, 'point')}")
        within = (np.abs(self.points_m) <= MAX_RANGE_M).all(axis=1)  # what is not a number is not, either
        if not within.all():
            number = int(np.flatnonzero(~within)[0])
            x_m, y_m, z_m = self.points_m[number].tolist()
            fault = f"point {number}, ({x_m:g}, {y_m:g}, {z_m:g}) m, is not within {MAX_RANGE_M:g} m of the LiDAR"
            raise InputError(fault)
