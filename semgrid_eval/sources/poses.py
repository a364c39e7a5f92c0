"""Speed and yaw rate from poses, as the integrator of logs puts them together again (`EgoMotion`, euler).

The speed of a sample is that of the step that begins at it, its yaw rate that of the step that ends at it; the last
speed and the first yaw rate are those of their neighbours.
"""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.geometry import SE3, yaw_of
from semgrid_eval.recording.types import MotionSample, Pose

_NS_PER_S = 1e9
Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


def speeds_mps(stamps_ns: Stamps, places: Floats) -> Floats:
    """Return the speed at each of at least two poses x, y, yaw: (N,), (N, 3) -> (N,), negative where it reverses."""
    x_m, y_m = np.diff(places[:, 0]), np.diff(places[:, 1])
    ahead_m = x_m * np.cos(places[:-1, 2]) + y_m * np.sin(places[:-1, 2])
    speeds = np.copysign(np.hypot(x_m, y_m), ahead_m) / _steps_s(stamps_ns)
    return np.append(speeds, speeds[-1])


def yaw_rates_radps(stamps_ns: Stamps, yaw_rad: Floats) -> Floats:
    """Return the yaw rate at each of at least two headings: (N,), (N,) -> (N,)."""
    rates = np.diff(np.unwrap(yaw_rad)) / _steps_s(stamps_ns)
    return np.insert(rates, 0, rates[0])


def motion_of(poses: list[Pose]) -> tuple[MotionSample, ...]:
    """Return the motion of at least two poses at their times, which grow."""
    stamps_ns = np.array([pose.stamp_ns for pose in poses], np.int64)
    places = np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses])
    columns = speeds_mps(stamps_ns, places).tolist(), yaw_rates_radps(stamps_ns, places[:, 2]).tolist()
    return tuple(MotionSample(*row) for row in zip(stamps_ns.tolist(), *columns, strict=True))


def planar(stamp_ns: int, map_from_vehicle: SE3) -> Pose:
    """Leave height, roll and pitch out of a pose in space."""
    x_m, y_m, _ = map_from_vehicle.translation_m.tolist()
    return Pose(stamp_ns, x_m, y_m, yaw_of(map_from_vehicle.rotation))


def _steps_s(stamps_ns: Stamps) -> Floats:
    """Return the steps between stamps, (N,) -> (N - 1,), in seconds."""
    return np.asarray(np.diff(stamps_ns) / _NS_PER_S, np.float64)
