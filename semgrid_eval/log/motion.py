"""Dead reckoning for viewers: where the vehicle is by its own speed and yaw rate."""

import math

from semgrid_eval.recording.types import MotionSample, Pose

_NS_PER_S = 1e9


class DeadReckoning:
    """Integrates motion samples in the order of time (Euler), from the origin at the first sample.

    As in the paper, a yaw rate turns the vehicle over the time before its sample, a speed moves it over the time after.
    """

    def __init__(self) -> None:
        self._last: MotionSample | None = None
        self._x_m = self._y_m = self._yaw_rad = 0.0

    def add(self, sample: MotionSample) -> None:
        """Move on to the time of the next sample."""
        if self._last is not None:
            here = self.pose_at(sample.stamp_ns)
            self._x_m, self._y_m = here.x_m, here.y_m
            self._yaw_rad += sample.yaw_rate_radps * (sample.stamp_ns - self._last.stamp_ns) / _NS_PER_S
        self._last = sample

    def pose_at(self, stamp_ns: int) -> Pose:
        """Return the pose in the odom frame at a time not before the last sample; its speed is held."""
        if self._last is None:
            return Pose(stamp_ns, 0.0, 0.0, 0.0)
        way_m = self._last.speed_mps * (stamp_ns - self._last.stamp_ns) / _NS_PER_S
        x_m = self._x_m + way_m * math.cos(self._yaw_rad)
        y_m = self._y_m + way_m * math.sin(self._yaw_rad)
        return Pose(stamp_ns, x_m, y_m, self._yaw_rad)
