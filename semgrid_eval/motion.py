"""Egomotion: what the vehicle reports of it, integrated over its own samples to any time (reading 17)."""

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE2

Integrator = Literal["euler", "arc"]
EXTRAPOLATION_LIMIT_S = 0.25
_NS_PER_S = 1e9
# What a road vehicle can plausibly do; beyond: a wrong unit or sign, or a broken sensor.
SPEED_MPS = (-15.0, 70.0)
YAW_RATE_RADPS = (-1.5, 1.5)
LIMITS = {"speed_mps": (SPEED_MPS, "m/s"), "yaw_rate_radps": (YAW_RATE_RADPS, "rad/s")}


@dataclass(frozen=True)
class MotionSample:
    """What the vehicle reports of its own motion at one time; GPS where it has one."""

    stamp_ns: int
    speed_mps: float
    yaw_rate_radps: float  # left-positive
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    heading_deg: float | None = None  # clockwise from north, as GPS gives it


def implausible(sample: MotionSample) -> tuple[str, str] | None:
    """Name the field of a sample that no road vehicle can have, and say why; None where there is none."""
    for name, ((low, high), unit) in LIMITS.items():
        value: float = getattr(sample, name)
        if not low <= value <= high:  # NaN is not, either
            return name, f"{value:g} {unit} is not within {low:g} to {high:g}"
    return None


@dataclass(frozen=True)
class Pose:
    """A planar pose of the vehicle frame in a fixed frame, `map` (x east, y north) or `odom`; yaw from x to y."""

    stamp_ns: int
    x_m: float
    y_m: float
    yaw_rad: float


class EgoMotion:
    """Integrates speed and yaw rate; the odom frame is the vehicle frame at the first sample.

    Euler is the paper's: heading adds the yaw rate of a sample times the interval that ends at it, position adds the
    speed of a sample times the interval that begins at it along the heading there. Arc takes both at the middle of an
    interval, between whose ends they are linear, and moves along the circle that they describe.

    Before the first sample, and after the last one that was added so far, the rates of that sample are held. So whoever
    knows motion only up to now adds samples as they come, in the order of time; whoever has a whole log adds all first.
    """

    def __init__(self, samples: Iterable[MotionSample] = (), integrator: Integrator = "euler") -> None:
        self._step = _euler if integrator == "euler" else _arc
        self._samples: list[MotionSample] = []
        self._stamps_ns: list[int] = []
        self._poses: list[SE2] = []
        for sample in samples:
            self.add(sample)

    def add(self, sample: MotionSample) -> None:
        """Add the next sample in the order of time."""
        here = SE2(0.0, 0.0, 0.0)
        if self._samples:
            here = self._step(self._poses[-1], self._samples[-1], sample, sample.stamp_ns)
        self._samples.append(sample)
        self._stamps_ns.append(sample.stamp_ns)
        self._poses.append(here)

    def odom_from_vehicle(self, stamp_ns: int) -> SE2:
        """Return where the vehicle is at a time, as far as the samples tell; the origin where there are none."""
        if not self._samples:
            return SE2(0.0, 0.0, 0.0)
        place = max(bisect_right(self._stamps_ns, stamp_ns) - 1, 0)
        before = self._samples[place]
        is_inside = self._stamps_ns[0] <= stamp_ns < self._stamps_ns[-1]
        after = self._samples[place + 1] if is_inside else before
        return self._step(self._poses[place], before, after, stamp_ns)

    def pose_at(self, stamp_ns: int) -> Pose:
        """Return the same as a pose in the odom frame."""
        here = self.odom_from_vehicle(stamp_ns)
        return Pose(stamp_ns, here.x_m, here.y_m, here.yaw_rad)

    def check_cover(self, stamp_ns: int) -> None:
        """Make sure that there is motion around a time.

        Raises:
            InputError: there is no motion, or none within a quarter second of the time.
        """
        if not self._samples:
            raise InputError("there are no motion samples", field="/ego/motion")
        outside_ns = max(self._stamps_ns[0] - stamp_ns, stamp_ns - self._stamps_ns[-1])
        if outside_ns > EXTRAPOLATION_LIMIT_S * _NS_PER_S:
            raise InputError(
                f"a frame lies {outside_ns / _NS_PER_S:.3f} s outside the motion samples", field="/ego/motion"
            )


def _euler(start: SE2, before: MotionSample, after: MotionSample, stamp_ns: int) -> SE2:
    """Move on from the pose at `before` to a time up to `after`."""
    interval_ns = stamp_ns - before.stamp_ns
    way_m = before.speed_mps * interval_ns / _NS_PER_S
    x_m = start.x_m + way_m * math.cos(start.yaw_rad)
    y_m = start.y_m + way_m * math.sin(start.yaw_rad)
    return SE2(x_m, y_m, start.yaw_rad + after.yaw_rate_radps * interval_ns / _NS_PER_S)


def _arc(start: SE2, before: MotionSample, after: MotionSample, stamp_ns: int) -> SE2:
    interval_s = (stamp_ns - before.stamp_ns) / _NS_PER_S
    between_ns = after.stamp_ns - before.stamp_ns
    share = 0.5 * (stamp_ns - before.stamp_ns) / between_ns if between_ns else 0.0
    speed_mps = before.speed_mps + share * (after.speed_mps - before.speed_mps)
    turn_rad = (before.yaw_rate_radps + share * (after.yaw_rate_radps - before.yaw_rate_radps)) * interval_s
    half_rad = turn_rad / 2
    chord_m = speed_mps * interval_s * (math.sin(half_rad) / half_rad if half_rad else 1.0)
    heading_rad = start.yaw_rad + half_rad
    return SE2(
        start.x_m + chord_m * math.cos(heading_rad),
        start.y_m + chord_m * math.sin(heading_rad),
        start.yaw_rad + turn_rad,
    )
