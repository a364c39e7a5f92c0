import math

import numpy as np
import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.motion import EgoMotion, MotionSample
from semgrid_eval.sources.ros2.mapping import MotionMap
from semgrid_eval.sources.ros2.motion import Track, rates_of

STEP_NS = 20_000_000
START_NS = 1_700_000_000_000_000_000


def track(topic, values, step_ns=STEP_NS, start_ns=START_NS):
    return Track(topic, [start_ns + number * step_ns for number in range(len(values))], list(values))


def motion(**changes):
    return MotionMap.model_validate({"speed": {"topic": "/odom"}, **changes})


def test_poses_of_an_arc_give_its_speed_and_yaw_rate_also_backwards():
    for speed in (6.0, -2.0):
        turns = [0.3 * number * STEP_NS * 1e-9 + 3.0 for number in range(20)]  # through half a turn, where yaw wraps
        poses = [
            (speed / 0.3 * math.sin(yaw), -speed / 0.3 * math.cos(yaw), math.remainder(yaw, math.tau)) for yaw in turns
        ]
        told = track("/odom", poses)
        found = rates_of(motion(speed={"topic": "/odom", "by": "pose"}), told, told, None)
        assert np.allclose(found.yaw_rate_radps, 0.3, atol=1e-9)
        assert np.allclose(found.speed_mps, speed, rtol=1e-5)


def test_poses_are_found_again_by_the_integrator_of_logs():
    driven = [MotionSample(START_NS + number * STEP_NS, 5 + number % 3, 0.1 * (number % 4 - 1)) for number in range(30)]
    poses = [EgoMotion(driven).pose_at(sample.stamp_ns) for sample in driven]
    told = track("/odom", [(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses])
    found = rates_of(motion(speed={"topic": "/odom", "by": "pose"}), told, told, None)
    again = EgoMotion(found.between(START_NS, driven[-1].stamp_ns))
    first = poses[0]
    for pose in poses:
        here = again.pose_at(pose.stamp_ns)
        assert (here.x_m, here.y_m, here.yaw_rad) == pytest.approx((pose.x_m, pose.y_m, pose.yaw_rad - first.yaw_rad))


def test_the_denser_topic_gives_the_stamps_and_the_other_is_interpolated():
    speed = track("/odom", [(float(number), 0.0) for number in range(5)], step_ns=100_000_000)
    imu = track("/imu", [(0.0, 0.0, 0.1 * number) for number in range(60)], step_ns=10_000_000)
    both = motion(yaw_rate={"topic": "/imu"})
    found = rates_of(both, speed, imu, np.array([0.0, 0.0, 1.0]))
    assert len(found.stamps_ns) == 41  # only where both are known
    assert np.allclose(found.speed_mps, np.linspace(0, 4, 41))
    assert np.allclose(found.yaw_rate_radps, 0.1 * np.arange(41))


def test_an_imu_that_hangs_upside_down_turns_the_other_way():
    imu = track("/imu", [(0.01, 0.02, 0.5)] * 9)
    speed = track("/odom", [(1.0, 0.0)] * 9)
    found = rates_of(motion(yaw_rate={"topic": "/imu"}), speed, imu, np.array([0.0, 0.0, -1.0]))
    assert np.allclose(found.yaw_rate_radps, -0.5)


def test_samples_are_sorted_and_of_equal_stamps_the_first_counts():
    told = Track("/odom", [30, 10, 20, 10], [(3.0, 0.0), (1.0, 0.0), (2.0, 0.0), (9.0, 0.0)])
    found = rates_of(motion(), told, told, None)
    assert found.stamps_ns.tolist() == [10, 20, 30]
    assert found.speed_mps.tolist() == [1.0, 2.0, 3.0]


def test_samples_between_begin_with_the_one_before():
    told = track("/odom", [(float(number), 0.0) for number in range(10)])
    found = rates_of(motion(), told, told, None)
    stamps = [sample.speed_mps for sample in found.between(START_NS + 5 * STEP_NS // 2, START_NS + 5 * STEP_NS)]
    assert stamps == [2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize(
    ("speed", "turning", "said"),
    [
        ([(1.0, 0.0)], [(0.0, 0.0, 0.0)] * 5, "/odom: has 1 sample of the motion; 2 are needed"),
        ([(1.0, 0.0)] * 5, [(0.0, 0.0, math.inf)] * 5, "/imu: .* is not finite"),
    ],
)
def test_motion_that_cannot_be_used(speed, turning, said):
    with pytest.raises(InputError, match=said):
        rates_of(
            motion(yaw_rate={"topic": "/imu"}), track("/odom", speed), track("/imu", turning), np.array([0, 0, 1.0])
        )


def test_topics_of_other_times():
    late = track("/imu", [(0.0, 0.0, 0.0)] * 5, start_ns=START_NS + 10**12)
    with pytest.raises(InputError, match="/imu: has no time in common with the topic that tells the speed"):
        rates_of(motion(yaw_rate={"topic": "/imu"}), track("/odom", [(1.0, 0.0)] * 5), late, np.array([0, 0, 1.0]))
