import math

import pytest
from semgrid_eval.log.motion import DeadReckoning

from semgrid_eval.recording.types import MotionSample, Pose

S = 1_000_000_000


def test_nothing_moves_before_the_first_sample():
    assert DeadReckoning().pose_at(5) == Pose(5, 0.0, 0.0, 0.0)


def test_straight_drive_covers_speed_times_time():
    reckoning = DeadReckoning()
    reckoning.add(MotionSample(10 * S, 4.0, 0.0))
    reckoning.add(MotionSample(12 * S, 1.0, 0.0))
    assert reckoning.pose_at(15 * S) == Pose(15 * S, 4.0 * 2 + 1.0 * 3, 0.0, 0.0)


def test_left_turn_leads_to_the_left():
    reckoning = DeadReckoning()
    reckoning.add(MotionSample(0, 2.0, 0.0))
    reckoning.add(MotionSample(1 * S, 2.0, math.pi / 2))
    pose = reckoning.pose_at(2 * S)
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((2.0, 2.0, math.pi / 2))


def test_yaw_rate_turns_over_the_time_before_its_sample():
    reckoning = DeadReckoning()
    reckoning.add(MotionSample(0, 0.0, 99.0))
    reckoning.add(MotionSample(2 * S, 0.0, 0.25))
    assert reckoning.pose_at(7 * S).yaw_rad == 0.5
