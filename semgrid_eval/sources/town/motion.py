"""How a car moves and what it reports: the path of its rear axle, its speed and its yaw rate."""

import math
from dataclasses import dataclass

import numpy as np

from semgrid_eval.geometry import Floats

FRONT_TO_REAR_AXLE_M = 3.8
SMOOTHING_S = 0.25
MAX_YAW_RATE_RADPS = 0.6
_MAX_STEP_M = 1.2  # 20 m/s at 17 Hz; what goes farther was moved by SUMO, not driven


@dataclass(frozen=True)
class Trajectory:
    """The rear axle's path on the clock of the simulation."""

    times_s: Floats  # (S,)
    position_m: Floats  # (S, 2) in the map frame
    yaw_rad: Floats  # (S,) continuous
    speed_mps: Floats  # (S,) along the heading
    yaw_rate_radps: Floats  # (S,) left-positive

    def at(self, time_s: float) -> tuple[float, float, float, float, float]:
        """Interpolate x, y, yaw, speed and yaw rate."""
        columns = (*self.position_m.T, self.yaw_rad, self.speed_mps, self.yaw_rate_radps)
        x_m, y_m, yaw_rad, speed_mps, yaw_rate_radps = (
            float(np.interp(time_s, self.times_s, column)) for column in columns
        )
        return x_m, y_m, yaw_rad, speed_mps, yaw_rate_radps


@dataclass(frozen=True)
class MotionNoise:
    """Errors of the reported motion: constant for a recording, white for a sample, and how old a value is."""

    speed_scale: float = 0.004  # standard deviation of the wheel circumference's relative error
    speed_mps: float = 0.02  # standard deviation of each reported speed
    yaw_rate_bias_radps: float = 0.0008  # standard deviation of the gyroscope's offset
    yaw_rate_radps: float = 0.0025  # standard deviation of each reported yaw rate
    latency_s: float = 0.02  # by which reports lag behind


EXACT_MOTION = MotionNoise(0.0, 0.0, 0.0, 0.0, 0.0)


def drive(times_s: Floats, front_m: Floats, heading_rad: Floats) -> Trajectory | None:
    """Turn a front bumper's track into the path of the rear axle, or None where the track jumps or breaks off.

    The track is smoothed, then the rear axle follows it as a wheel does: it always moves along the vehicle's heading,
    so that speed and yaw rate integrate to the path. The track is the middle of the front bumper (S, 2) at evenly
    spaced times, NaN where the vehicle is not there; of SUMO's headings (S,) only the first is used.
    """
    if np.isnan(front_m).any() or np.linalg.norm(np.diff(front_m, axis=0), axis=1).max() > _MAX_STEP_M:
        return None
    step_s = float(times_s[1] - times_s[0])
    front = _smoothed(front_m, SMOOTHING_S / step_s)
    yaw = _followed_yaw(front, float(heading_rad[0]))
    rear = front - FRONT_TO_REAR_AXLE_M * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    velocity = np.gradient(rear, step_s, axis=0)
    speed = velocity[:, 0] * np.cos(yaw) + velocity[:, 1] * np.sin(yaw)
    return Trajectory(times_s, rear, yaw, speed, np.gradient(yaw, step_s))


def report(path: Trajectory, times_s: Floats, noise: MotionNoise, rng: np.random.Generator) -> Floats:
    """Return what the vehicle reports at some times: (N, 2) speed and yaw rate."""
    seen_s = times_s - noise.latency_s
    speed = np.interp(seen_s, path.times_s, path.speed_mps) * (1.0 + noise.speed_scale * rng.standard_normal())
    yaw_rate = np.interp(seen_s, path.times_s, path.yaw_rate_radps) + noise.yaw_rate_bias_radps * rng.standard_normal()
    errors = rng.standard_normal((len(times_s), 2)) * (noise.speed_mps, noise.yaw_rate_radps)
    moving = np.abs(speed) > 0.05  # a wheel that stands reports exactly nothing
    return np.stack([np.where(moving, speed + errors[:, 0], 0.0), yaw_rate + errors[:, 1]], axis=1)


def _followed_yaw(front_m: Floats, yaw_rad: float) -> Floats:
    """Return the heading (S,) of a vehicle whose front is led along points (S, 2) and whose rear axle follows.

    Along a straight step s the angle phi between heading and step shrinks as tan(phi / 2) exp(-s / L): the tractrix.
    """
    yaws = [yaw_rad]
    for step_x, step_y in np.diff(front_m, axis=0).tolist():
        way = math.atan2(step_y, step_x)
        slip = math.remainder(yaws[-1] - way, math.tau)
        shrunk = 2.0 * math.atan(math.tan(slip / 2.0) * math.exp(-math.hypot(step_x, step_y) / FRONT_TO_REAR_AXLE_M))
        yaws.append(yaws[-1] + shrunk - slip)
    return np.array(yaws)


def _smoothed(points: Floats, sigma: float) -> Floats:
    """Smooth points (S, 2) by a Gaussian of `sigma` samples; the ends are continued in a straight line."""
    reach = int(np.ceil(3.0 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(points, ((reach, reach), (0, 0)), "reflect", reflect_type="odd")
    return np.stack([np.convolve(column, kernel, "valid") for column in padded.T], axis=1)
