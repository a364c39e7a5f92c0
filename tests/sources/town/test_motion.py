import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.sources.town.drives import EXACT_MOTION, FRONT_TO_REAR_AXLE_M, MotionNoise, drive, report

STEP_S = 0.059
TIMES_S = 60.0 + STEP_S * np.arange(90)


def circle(speed_mps: float, radius_m: float):
    """The front bumper of a car whose rear axle turns left (or right) about the origin."""
    reach_m = math.hypot(radius_m, FRONT_TO_REAR_AXLE_M)
    lead_rad = (
        math.atan2(FRONT_TO_REAR_AXLE_M, radius_m) if radius_m > 0 else -math.atan2(FRONT_TO_REAR_AXLE_M, -radius_m)
    )
    angle = speed_mps / radius_m * (TIMES_S - TIMES_S[0])
    side = -math.pi / 2 if radius_m > 0 else math.pi / 2
    front = reach_m * np.stack([np.cos(angle + side + lead_rad), np.sin(angle + side + lead_rad)], axis=1)
    return front, angle


@given(speed_mps=st.floats(2.0, 12.0), radius_m=st.floats(30.0, 80.0), left=st.booleans())
def test_on_a_circle_speed_and_yaw_rate_are_those_of_the_rear_axle(speed_mps, radius_m, left):
    radius_m = radius_m if left else -radius_m
    front, heading = circle(speed_mps, radius_m)
    path = drive(TIMES_S, front, heading)
    inner = slice(20, -20)
    np.testing.assert_allclose(path.speed_mps[inner], speed_mps, rtol=0.02)
    np.testing.assert_allclose(path.yaw_rate_radps[inner], speed_mps / radius_m, rtol=0.03)
    np.testing.assert_allclose(np.linalg.norm(path.position_m[inner], axis=1), abs(radius_m), rtol=0.02)


def test_speed_and_yaw_rate_integrate_to_the_path_of_a_lane_change():
    along = 8.0 * (TIMES_S - TIMES_S[0])
    front = np.stack([along, 1.6 * np.tanh((along - 20.0) / 6.0)], axis=1)
    path = drive(TIMES_S, front, np.zeros(90))
    x_m, y_m, yaw_rad = *path.position_m[20], path.yaw_rad[20]
    for index in range(20, 70):
        x_m += STEP_S * path.speed_mps[index : index + 2].mean() * math.cos(path.yaw_rad[index : index + 2].mean())
        y_m += STEP_S * path.speed_mps[index : index + 2].mean() * math.sin(path.yaw_rad[index : index + 2].mean())
        yaw_rad += STEP_S * path.yaw_rate_radps[index : index + 2].mean()
    assert (x_m, y_m) == pytest.approx(tuple(path.position_m[70]), abs=0.03)
    assert yaw_rad == pytest.approx(path.yaw_rad[70], abs=0.005)


def test_a_track_that_jumps_or_breaks_off_is_refused():
    front, heading = circle(5.0, 30.0)
    jump, gap = front.copy(), front.copy()
    jump[40:] += 3.0
    gap[40] = np.nan
    assert drive(TIMES_S, front, heading) is not None
    assert drive(TIMES_S, jump, heading) is None
    assert drive(TIMES_S, gap, heading) is None


def test_reports_are_late_and_noisy_but_a_standing_wheel_reports_nothing():
    front = np.stack([0.5 * 2.0 * (TIMES_S - TIMES_S[0]) ** 2, np.zeros(90)], axis=1)  # 2 m/s^2
    path = drive(TIMES_S, front, np.zeros(90))
    times_s = TIMES_S[20:60]
    exact = report(path, times_s, EXACT_MOTION, np.random.default_rng(0))
    late = report(path, times_s, MotionNoise(0.0, 0.0, 0.0, 0.0, latency_s=0.1), np.random.default_rng(0))
    np.testing.assert_allclose(exact[:, 0] - late[:, 0], 0.2, atol=0.01)
    noisy = report(path, times_s, MotionNoise(0.0, 0.5, 0.0, 0.1, 0.0), np.random.default_rng(0))
    assert 0.3 < np.std(noisy[:, 0] - exact[:, 0]) < 0.7
    still = drive(TIMES_S, np.zeros((90, 2)), np.zeros(90))
    assert (report(still, times_s, MotionNoise(), np.random.default_rng(0))[:, 0] == 0.0).all()
