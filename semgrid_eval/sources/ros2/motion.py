"""The motion of the vehicle from odometry, twists and inertial sensors, as samples of speed and yaw rate."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import yaw_of
from semgrid_eval.recording.types import MotionSample
from semgrid_eval.sources.poses import speeds_mps, yaw_rates_radps
from semgrid_eval.sources.ros2.kinds import IMU, ODOMETRY
from semgrid_eval.sources.ros2.mapping import MotionMap
from semgrid_eval.sources.ros2.transforms import rotation_of
from semgrid_eval.words import plural

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rates:
    """Speed and yaw rate at growing stamps, all (N,)."""

    stamps_ns: NDArray[np.int64]
    speed_mps: Floats
    yaw_rate_radps: Floats

    def between(self, first_ns: int, last_ns: int) -> tuple[MotionSample, ...]:
        """Return the samples from the one at or before `first_ns` to the one at or before `last_ns`."""
        start = max(int(np.searchsorted(self.stamps_ns, first_ns, side="right")) - 1, 0)
        stop = int(np.searchsorted(self.stamps_ns, last_ns, side="right"))
        columns = (self.stamps_ns, self.speed_mps, self.yaw_rate_radps)
        return tuple(MotionSample(*row) for row in zip(*(each[start:stop].tolist() for each in columns), strict=True))


@dataclass
class Track:
    """What one topic tells of the motion, message by message: stamp, then what `values_of` returns."""

    topic: str
    stamps_ns: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)

    def sorted(self) -> tuple[NDArray[np.int64], Floats]:
        """Return stamps (N,) and values (N, K) in the order of time, of equal stamps the first."""
        stamps, first = np.unique(np.array(self.stamps_ns, np.int64), return_index=True)
        return stamps, np.array(self.values, np.float64)[first]


def values_of(message: Any, kind: str, by: str) -> tuple[float, ...]:  # noqa: ANN401 - a class that rosbags makes
    """Return x, y and yaw of a pose; speed and yaw rate of a twist; or the three rates of an Imu."""
    if kind == IMU:
        rate = message.angular_velocity
        return rate.x, rate.y, rate.z
    if by == "pose":
        pose = message.pose.pose
        return pose.position.x, pose.position.y, yaw_of(rotation_of(pose.orientation))
    twist = message.twist.twist if kind == ODOMETRY else message.twist
    return twist.linear.x, twist.angular.z


def rates_of(motion: MotionMap, speed: Track, turning: Track, imu_turn: Floats | None) -> Rates:
    """Join what the topics tell at the stamps of the one that is denser; the other is interpolated.

    Args:
        motion: what the topics are.
        speed: of the topic that tells the speed.
        turning: of the topic that tells the yaw rate.
        imu_turn: (3,) the vehicle's z axis in the frame of an Imu; None where it is none.

    Raises:
        InputError: there are fewer than two samples, or one is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
        stamps_ns, speed_mps = _speed(motion.speed.by, speed)
        others_ns, yaw_rate = _yaw_rate(motion.turning.by, turning, imu_turn)
    if turning.topic == speed.topic:
        return _checked(Rates(stamps_ns, speed_mps, yaw_rate), speed.topic)
    shared_ns = max(stamps_ns[0], others_ns[0]), min(stamps_ns[-1], others_ns[-1])
    at_ns = stamps_ns if len(stamps_ns) >= len(others_ns) else others_ns
    at_ns = at_ns[(at_ns >= shared_ns[0]) & (at_ns <= shared_ns[1])]
    speeds = _interpolated(at_ns, stamps_ns, speed_mps)
    return _checked(Rates(at_ns, speeds, _interpolated(at_ns, others_ns, yaw_rate)), turning.topic)


def _speed(by: str, track: Track) -> tuple[NDArray[np.int64], Floats]:
    stamps_ns, values = _enough(track)
    if by == "twist":
        return stamps_ns, values[:, 0]
    return stamps_ns, speeds_mps(stamps_ns, values)


def _yaw_rate(by: str, track: Track, imu_turn: Floats | None) -> tuple[NDArray[np.int64], Floats]:
    stamps_ns, values = _enough(track)
    if imu_turn is not None:
        return stamps_ns, values @ imu_turn
    if by == "twist":
        return stamps_ns, values[:, 1]
    return stamps_ns, yaw_rates_radps(stamps_ns, values[:, 2])


def _enough(track: Track) -> tuple[NDArray[np.int64], Floats]:
    if len(set(track.stamps_ns)) < 2:
        raise InputError(
            f"has {plural(len(set(track.stamps_ns)), 'sample')} of the motion; 2 are needed", field=track.topic
        )
    return track.sorted()


def _checked(rates: Rates, topic: str) -> Rates:
    if len(rates.stamps_ns) < 2:
        raise InputError("has no time in common with the topic that tells the speed", field=topic)
    for values in (rates.speed_mps, rates.yaw_rate_radps):
        if len(wrong := np.flatnonzero(~np.isfinite(values))):
            raise InputError(f"{values[wrong[0]]} at {rates.stamps_ns[wrong[0]]} ns is not finite", field=topic)
    return rates


def _interpolated(at_ns: NDArray[np.int64], stamps_ns: NDArray[np.int64], values: Floats) -> Floats:
    start_ns = stamps_ns[0]  # differences of stamps keep their digits as floating point
    return np.asarray(np.interp(at_ns - start_ns, stamps_ns - start_ns, values), np.float64)
