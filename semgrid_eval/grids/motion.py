"""Egomotion integrated over its own samples to any time (paper, "semantic grids"; reading 17)."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.recording.types import MotionSample

Floats = NDArray[np.float64]

EXTRAPOLATION_LIMIT_S = 0.25


def integrate_motion(
    samples: Sequence[MotionSample], times_ns: NDArray[np.int64], integrator: Literal["euler", "arc"] = "euler"
) -> tuple[Floats, Floats]:
    """Integrate speed and yaw rate from the first asked time to all of them.

    Euler is the paper's: heading adds the yaw rate of a sample times the interval that ends at it, position adds the
    speed of a sample times the interval that begins at it along the heading there. Arc takes the means of both over
    each interval and moves along the circle that they describe.

    Args:
        samples: motion in the order of time.
        times_ns: (F,) times asked for, in order, at most a quarter second outside the samples.
        integrator: `euler` or `arc`.

    Returns:
        Position (F, 2) in metres, forward and left of the pose at `times_ns[0]`, and yaw (F,) in radians, both zero
        at the first time.

    Raises:
        InputError: there is no motion, or none near a time that is asked for.
    """
    if not samples:
        raise InputError("there are no motion samples", field="/ego/motion")
    stamps_ns = np.array([sample.stamp_ns for sample in samples], np.int64)
    _check_cover(stamps_ns, times_ns)
    grid_ns = np.union1d(stamps_ns, times_ns)
    speed_mps, yaw_rate_radps = _rates_of_intervals(samples, stamps_ns, grid_ns, integrator)
    interval_s = np.diff(grid_ns) * 1e-9
    turn_rad = yaw_rate_radps * interval_s
    yaw_rad = np.concatenate(([0.0], np.cumsum(turn_rad)))
    if integrator == "euler":
        held = np.maximum(np.searchsorted(stamps_ns, grid_ns[:-1], side="right") - 1, 0)
        heading_rad = yaw_rad[np.searchsorted(grid_ns, stamps_ns[held])]
        length_m = speed_mps * interval_s
    else:
        heading_rad = yaw_rad[:-1] + 0.5 * turn_rad
        length_m = speed_mps * interval_s * np.sinc(turn_rad / (2 * np.pi))  # chord of the arc
    step_m = length_m[:, None] * np.stack([np.cos(heading_rad), np.sin(heading_rad)], axis=1)
    position_m = np.concatenate([np.zeros((1, 2)), np.cumsum(step_m, axis=0)])
    return _relative_to_first(position_m, yaw_rad, np.searchsorted(grid_ns, times_ns))


def _rates_of_intervals(
    samples: Sequence[MotionSample], stamps_ns: NDArray[np.int64], grid_ns: NDArray[np.int64], integrator: str
) -> tuple[Floats, Floats]:
    speed_mps = np.array([sample.speed_mps for sample in samples])
    yaw_rate_radps = np.array([sample.yaw_rate_radps for sample in samples])
    if integrator == "euler":
        before = np.maximum(np.searchsorted(stamps_ns, grid_ns[:-1], side="right") - 1, 0)
        after = np.minimum(np.searchsorted(stamps_ns, grid_ns[1:], side="left"), len(stamps_ns) - 1)
        return speed_mps[before], yaw_rate_radps[after]
    middle_s = (grid_ns[:-1] - stamps_ns[0] + 0.5 * np.diff(grid_ns)) * 1e-9
    stamps_s = (stamps_ns - stamps_ns[0]) * 1e-9
    return np.interp(middle_s, stamps_s, speed_mps), np.interp(middle_s, stamps_s, yaw_rate_radps)


def _relative_to_first(position_m: Floats, yaw_rad: Floats, index: NDArray[np.intp]) -> tuple[Floats, Floats]:
    first = index[0]
    cosine, sine = np.cos(yaw_rad[first]), np.sin(yaw_rad[first])
    first_from_start = np.array([[cosine, sine], [-sine, cosine]])
    return (position_m[index] - position_m[first]) @ first_from_start.T, yaw_rad[index] - yaw_rad[first]


def _check_cover(stamps_ns: NDArray[np.int64], times_ns: NDArray[np.int64]) -> None:
    outside_s = max(stamps_ns[0] - times_ns.min(), times_ns.max() - stamps_ns[-1]) * 1e-9
    if outside_s > EXTRAPOLATION_LIMIT_S:
        raise InputError(f"a frame lies {outside_s:.3f} s outside the motion samples", field="/ego/motion")
