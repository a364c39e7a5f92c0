"""Bring the points of a turning LiDAR, each measured at its own time, to one time by the vehicle's motion."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.geometry import SE3
from semgrid_eval.motion import EgoMotion

_KNOT_NS = 1_000_000
"""Between poses so close, 5 cm on a motorway, the vehicle moves straight and turns evenly."""
Floats = NDArray[np.float64]


def deskewed(points_m: Floats, offset_ns: Floats, stamp_ns: int, ego_from_sensor: SE3, motion: EgoMotion) -> Floats:
    """Move points (N, 3) in the axes of their sensor to where the sensor sees them at `stamp_ns`: (N, 3).

    What was measured at t is at ego(stamp)_from_ego(t) @ ego_from_sensor @ p; things that move themselves stay where
    they were measured. `offset_ns` (N,) is t - stamp.
    """
    if not len(points_m):
        return points_m
    first_ns, last_ns = float(offset_ns.min()), float(offset_ns.max())
    knots_ns = np.linspace(first_ns, last_ns, 2 + int((last_ns - first_ns) // _KNOT_NS))
    now = motion.odom_from_vehicle(stamp_ns)
    poses = [motion.odom_from_vehicle(stamp_ns + round(knot)).seen_from(now) for knot in knots_ns.tolist()]
    told = np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses])
    x_m, y_m, yaw_rad = (np.interp(offset_ns, knots_ns, column) for column in told.T)
    forward_m, left_m, up_m = ego_from_sensor.apply(points_m).T
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    moved = (x_m + cosine * forward_m - sine * left_m, y_m + sine * forward_m + cosine * left_m, up_m)
    return ego_from_sensor.inverse().apply(np.stack(moved, axis=-1))
