"""Points of a turning LiDAR on a vehicle that drives and turns, worked out by school geometry."""

import math

import numpy as np
import pytest

from semgrid_eval.geometry import SE3
from semgrid_eval.motion import EgoMotion, MotionSample
from semgrid_eval.sources.deskewing import deskewed

SPEED_MPS, YAW_RATE = 15.0, 0.4
STAMP_NS, TURN_NS = 10**18, 100_000_000
MOUNT = SE3.from_roll_pitch_yaw(0.02, 0.05, 2.0, (1.2, -0.3, 1.8))
WALL_M = 20.0  # how far ahead of where the vehicle is at the stamp the wall x = 20 stands


def motion(speed_mps=SPEED_MPS, yaw_rate=YAW_RATE):
    stamps_ns = range(STAMP_NS - 200_000_000, STAMP_NS + 200_000_001, 20_000_000)
    return EgoMotion((MotionSample(stamp_ns, speed_mps, yaw_rate) for stamp_ns in stamps_ns), "arc")


def vehicle_at(since_s, speed_mps=SPEED_MPS, yaw_rate=YAW_RATE):
    """Where the vehicle is in its own axes at the stamp, on a true arc."""
    yaw = yaw_rate * since_s
    way = (
        (speed_mps * since_s, 0.0)
        if not yaw_rate
        else (speed_mps / yaw_rate * math.sin(yaw), speed_mps / yaw_rate * (1 - math.cos(yaw)))
    )
    return SE3.from_roll_pitch_yaw(0.0, 0.0, yaw, (*way, 0.0))


def scanned(offset_ns, **driven):
    """Points of the wall, as the LiDAR sees each at its time: left to right over a turn."""
    lefts_m = np.linspace(8.0, -8.0, len(offset_ns))
    seen = []
    for left_m, offset in zip(lefts_m, offset_ns, strict=True):
        sensor_now = vehicle_at(offset * 1e-9, **driven) @ MOUNT
        seen.append(sensor_now.inverse().apply(np.array([WALL_M, left_m, 0.5])))
    return np.array(seen), lefts_m


@pytest.mark.parametrize("start_ns", [0, -TURN_NS, -TURN_NS // 2])
def test_a_wall_comes_out_straight_while_driving_and_turning(start_ns):
    offset_ns = start_ns + np.linspace(0, TURN_NS, 200)
    seen, lefts_m = scanned(offset_ns)
    found = MOUNT.apply(deskewed(seen, offset_ns, STAMP_NS, MOUNT, motion()))
    expected = np.stack([np.full(200, WALL_M), lefts_m, np.full(200, 0.5)], axis=-1)
    assert np.abs(found - expected).max() < 1e-4
    bent = MOUNT.apply(seen)
    assert np.abs(bent - expected).max() > 0.9


def test_without_times_it_is_bent_by_what_the_vehicle_drives_and_turns_in_a_turn():
    """At 15 m/s straight on, what is measured 0.1 s later is 1.5 m nearer; at 0.4 rad/s on the spot it turns by .04."""
    offset_ns = np.linspace(0, TURN_NS, 3)
    seen, _ = scanned(offset_ns, speed_mps=15.0, yaw_rate=0.0)
    assert MOUNT.apply(seen)[:, 0] == pytest.approx([20.0, 19.25, 18.5], abs=1e-9)
    seen, _ = scanned(offset_ns, speed_mps=0.0, yaw_rate=0.4)
    angle, range_m = math.atan2(-8.0, 20.0) - 0.04, math.hypot(20.0, 8.0)
    expected = (range_m * math.cos(angle), range_m * math.sin(angle))
    assert MOUNT.apply(seen)[2, :2] == pytest.approx(expected)


def test_points_of_the_time_of_the_stamp_stay_and_no_points_are_none():
    seen, _ = scanned(np.zeros(4))
    assert np.allclose(deskewed(seen, np.zeros(4), STAMP_NS, MOUNT, motion()), seen, atol=1e-12)
    assert deskewed(np.zeros((0, 3)), np.zeros(0), STAMP_NS, MOUNT, motion()).shape == (0, 3)
