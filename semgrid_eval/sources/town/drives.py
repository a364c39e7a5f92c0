"""Which simulated car is the ego vehicle and when, how it moves, and what it reports of its motion."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import Floats
from semgrid_eval.sources.town.config import FRAME_COUNT
from semgrid_eval.sources.town.simulation import STEP_S
from semgrid_eval.sources.town.traffic import CAR_TYPES, Traffic
from semgrid_eval.words import plural

FRONT_TO_REAR_AXLE_M = 3.8
SMOOTHING_S = 0.25
MAX_YAW_RATE_RADPS = 0.6
_MAX_STEP_M = 1.2  # 20 m/s at 17 Hz; what goes farther was moved by SUMO, not driven
FRAME_RATE_HZ = 17.0
STANDING_SHARE = 1.0 / 3.0
STANDING_BELOW_MPS = 2.0
CRUISE_MPS = (7.0, 2.6)  # mean and standard deviation of the drawn speeds of the rest
CRUISE_LIMITS_MPS = (2.0, 13.0)
_LEAD_STEPS = 40  # before a window, for the rear axle to find its track
_SPARE_STEPS = 3  # of a window, for stamps that are off and steps that are not the frames' own
_TAIL_STEPS = 14  # after a window, for smoothing
_STRIDE_STEPS = 5
_APART_STEPS = 27  # between two windows of one car
_CHECKED_FRAMES = 10  # between two looks at who is inside the ego vehicle
_CANDIDATES = 48
_EGO_BOX_M = (-1.0, 4.3, 0.9)  # from, to, half width: nobody may be inside


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
        x_m, y_m, yaw_rad, speed, yaw_rate = (float(np.interp(time_s, self.times_s, column)) for column in columns)
        return x_m, y_m, yaw_rad, speed, yaw_rate


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


@dataclass(frozen=True)
class Drive:
    """A window of one simulated car."""

    actor: int
    start_s: float
    frames: int = FRAME_COUNT

    @property
    def duration_s(self) -> float:
        """Time from the first frame to the one after the last."""
        return self.frames / FRAME_RATE_HZ


def ego_path(traffic: Traffic, chosen: Drive) -> Trajectory | None:
    """Return the rear axle's path around a window, or None where the track is not one that a car drives."""
    first = traffic.step_before(chosen.start_s) - _LEAD_STEPS
    end = first + _LEAD_STEPS + _window_steps(chosen.frames) + _TAIL_STEPS
    front_m, heading_rad = traffic.track(chosen.actor, first, end)
    return drive(np.asarray(traffic.times_s[first:end]), front_m, heading_rad)


def _window_steps(frames: int) -> int:
    """Return how many steps of the simulation hold so many frames."""
    return math.ceil(frames / (FRAME_RATE_HZ * STEP_S)) + _SPARE_STEPS


def needed_s(frames: int) -> float:
    """Return how long a car must be there for a window of so many frames."""
    return (_LEAD_STEPS + _window_steps(frames) + _TAIL_STEPS) * STEP_S


def choose_drives(traffic: Traffic, count: int, rng: np.random.Generator, frames: int = FRAME_COUNT) -> list[Drive]:
    """Choose windows: a third standing or crawling, the rest by speeds drawn around 7 m/s; no two overlap in one car.

    Speeds are means over a window. Traffic that does not hold so many windows is an InputError.
    """
    apart = _window_steps(frames) + _APART_STEPS
    actors, steps, speeds = _candidates(traffic, _window_steps(frames))
    free = np.ones(len(actors), bool)
    chosen: list[Drive] = []
    for target_mps in _target_speeds(count, rng):
        while True:
            index = _closest(speeds, free, target_mps, rng)
            if index is None:
                raise InputError(
                    f"the town's traffic holds only {len(chosen)} of {count} windows of {plural(frames, 'frame')}; "
                    "ask for fewer recordings, more towns, a larger town or a longer time"
                )
            free[index] = False
            window = Drive(int(actors[index]), float(traffic.times_s[steps[index]]), frames)
            if _is_drivable(traffic, window):
                break
        free &= (actors != actors[index]) | (np.abs(steps - steps[index]) > apart)
        chosen.append(window)
    return chosen


def _candidates(
    traffic: Traffic, window_steps: int
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.float64]]:
    """Return actor, first step and mean speed of every window of every car, one in five steps."""
    rows = np.flatnonzero(np.isin(traffic.actor_types, CAR_TYPES)[traffic.actor])
    step_of_row = np.repeat(np.arange(len(traffic.times_s)), np.diff(traffic.offsets))
    order = rows[np.lexsort((step_of_row[rows], traffic.actor[rows]))]
    actor, step = np.asarray(traffic.actor[order]), step_of_row[order]
    covered_m = np.append(0.0, np.cumsum(traffic.speed_mps[order], dtype=np.float64))
    first = np.arange(_LEAD_STEPS, len(order) - window_steps - _TAIL_STEPS, _STRIDE_STEPS)
    begin, end = first - _LEAD_STEPS, first + window_steps + _TAIL_STEPS
    whole = (actor[begin] == actor[end]) & (step[end] - step[begin] == end - begin)
    first = first[whole]
    speed = (covered_m[first + window_steps] - covered_m[first]) / window_steps
    return actor[first], step[first], speed


def _target_speeds(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    standing = round(count * STANDING_SHARE)
    slow = rng.uniform(0.0, STANDING_BELOW_MPS, standing) * (rng.random(standing) < 0.5)
    cruising = np.clip(rng.normal(*CRUISE_MPS, count - standing), *CRUISE_LIMITS_MPS)
    return rng.permutation(np.concatenate([slow, cruising]))


def _closest(
    speeds: NDArray[np.float64], free: NDArray[np.bool_], target_mps: float, rng: np.random.Generator
) -> int | None:
    """Return, of some free candidates taken at random, the one whose speed is nearest to the target."""
    candidates = np.flatnonzero(free)
    if len(candidates) == 0:
        return None
    some = rng.choice(candidates, min(_CANDIDATES, len(candidates)), replace=False)
    return int(some[np.argmin(np.abs(speeds[some] - target_mps))])


def _is_drivable(traffic: Traffic, window: Drive) -> bool:
    """Return whether a car could have driven this, and nobody stands inside the ego vehicle (in SUMO some overlap)."""
    path = ego_path(traffic, window)
    if path is None or np.abs(path.yaw_rate_radps).max() > MAX_YAW_RATE_RADPS:
        return False
    for time_s in np.linspace(
        window.start_s, window.start_s + window.duration_s, 1 + math.ceil(window.frames / _CHECKED_FRAMES)
    ):
        x_m, y_m, yaw_rad, _, _ = path.at(float(time_s))
        others = traffic.at(float(time_s))
        away = others.centre_m[others.actor != window.actor] - (x_m, y_m)
        ahead_m = away @ (np.cos(yaw_rad), np.sin(yaw_rad))
        left_m = away @ (-np.sin(yaw_rad), np.cos(yaw_rad))
        rear_m, front_m, side_m = _EGO_BOX_M
        if np.any((ahead_m > rear_m) & (ahead_m < front_m) & (np.abs(left_m) < side_m)):
            return False
    return True
