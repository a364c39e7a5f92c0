"""Chooses which simulated car is the ego vehicle, and when, so that speeds are mixed as in recorded traffic."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.sources.town.motion import MAX_YAW_RATE_RADPS, Trajectory, drive
from semgrid_eval.sources.town.road_users import CAR_TYPES
from semgrid_eval.sources.town.traffic import Traffic

FRAME_COUNT = 30
FRAME_RATE_HZ = 17.0
STANDING_SHARE = 1.0 / 3.0
STANDING_BELOW_MPS = 2.0
CRUISE_MPS = (7.0, 2.6)  # mean and standard deviation of the drawn speeds of the rest
CRUISE_LIMITS_MPS = (2.0, 13.0)
_LEAD_STEPS = 40  # before a window, for the rear axle to find its track
_WINDOW_STEPS = 33
_TAIL_STEPS = 14  # after a window, for smoothing
_STRIDE_STEPS = 5
_APART_STEPS = 60  # between two windows of one car
_CANDIDATES = 48
_EGO_BOX_M = (-1.0, 4.3, 0.9)  # from, to, half width: nobody may be inside


@dataclass(frozen=True)
class Drive:
    """A window of 30 frames of one simulated car."""

    actor: int
    start_s: float


def ego_path(traffic: Traffic, chosen: Drive) -> Trajectory | None:
    """Return the rear axle's path around a window, or None where the track is not one that a car drives."""
    first = traffic.step_before(chosen.start_s) - _LEAD_STEPS
    end = first + _LEAD_STEPS + _WINDOW_STEPS + _TAIL_STEPS
    front_m, heading_rad = traffic.track(chosen.actor, first, end)
    return drive(np.asarray(traffic.times_s[first:end]), front_m, heading_rad)


def choose_drives(traffic: Traffic, count: int, rng: np.random.Generator) -> list[Drive]:
    """Choose windows: a third standing or crawling, the rest by speeds drawn around 7 m/s; no two overlap in one car.

    Raises:
        InputError: the town's traffic does not hold so many windows.
    """
    actors, steps, speeds = _candidates(traffic)
    free = np.ones(len(actors), bool)
    chosen: list[Drive] = []
    for target_mps in _target_speeds(count, rng):
        while True:
            index = _closest(speeds, free, target_mps, rng)
            if index is None:
                raise InputError(
                    f"the town's traffic holds only {len(chosen)} of {count} windows; "
                    "ask for fewer recordings, more towns, a larger town or a longer time"
                )
            free[index] = False
            window = Drive(int(actors[index]), float(traffic.times_s[steps[index]]))
            if _is_drivable(traffic, window):
                break
        free &= (actors != actors[index]) | (np.abs(steps - steps[index]) > _APART_STEPS)
        chosen.append(window)
    return chosen


def _candidates(traffic: Traffic) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.float64]]:
    """Return actor, first step and mean speed of every window of every car, one in five steps."""
    rows = np.flatnonzero(np.isin(traffic.actor_types, CAR_TYPES)[traffic.actor])
    step_of_row = np.repeat(np.arange(len(traffic.times_s)), np.diff(traffic.offsets))
    order = rows[np.lexsort((step_of_row[rows], traffic.actor[rows]))]
    actor, step = np.asarray(traffic.actor[order]), step_of_row[order]
    covered_m = np.append(0.0, np.cumsum(traffic.speed_mps[order], dtype=np.float64))
    first = np.arange(_LEAD_STEPS, len(order) - _WINDOW_STEPS - _TAIL_STEPS, _STRIDE_STEPS)
    begin, end = first - _LEAD_STEPS, first + _WINDOW_STEPS + _TAIL_STEPS
    whole = (actor[begin] == actor[end]) & (step[end] - step[begin] == end - begin)
    first = first[whole]
    speed = (covered_m[first + _WINDOW_STEPS] - covered_m[first]) / _WINDOW_STEPS
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
    for time_s in np.linspace(window.start_s, window.start_s + FRAME_COUNT / FRAME_RATE_HZ, 4):
        x_m, y_m, yaw_rad, _, _ = path.at(float(time_s))
        others = traffic.at(float(time_s))
        away = others.centre_m[others.actor != window.actor] - (x_m, y_m)
        ahead_m = away @ (np.cos(yaw_rad), np.sin(yaw_rad))
        left_m = away @ (-np.sin(yaw_rad), np.cos(yaw_rad))
        rear_m, front_m, side_m = _EGO_BOX_M
        if np.any((ahead_m > rear_m) & (ahead_m < front_m) & (np.abs(left_m) < side_m)):
            return False
    return True
