import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.errors import InputError
from semgrid_eval.motion import EgoMotion, MotionSample, Pose

S = 1_000_000_000


def samples_of(stamps_ns, speeds, yaw_rates):
    return [MotionSample(int(t), float(v), float(w)) for t, v, w in zip(stamps_ns, speeds, yaw_rates, strict=True)]


def integrate_motion(samples, times_ns, integrator="euler"):
    """Positions (F, 2) and yaw (F,) against the first of the times."""
    motion = EgoMotion(samples, integrator)
    poses = [motion.odom_from_vehicle(int(stamp_ns)) for stamp_ns in times_ns]
    seen = [pose.seen_from(poses[0]) for pose in poses]
    return np.array([(pose.x_m, pose.y_m) for pose in seen]), np.array([pose.yaw_rad for pose in seen])


def slow_euler(samples):
    """The paper's two sums, one frame after the other."""
    x = y = yaw = 0.0
    poses = [(x, y, yaw)]
    for before, after in itertools.pairwise(samples):
        dt = (after.stamp_ns - before.stamp_ns) / 1e9
        x += before.speed_mps * dt * math.cos(yaw)
        y += before.speed_mps * dt * math.sin(yaw)
        yaw += after.yaw_rate_radps * dt
        poses.append((x, y, yaw))
    return np.array(poses)


steps = st.lists(
    st.tuples(st.integers(20_000_000, 120_000_000), st.floats(-2, 30), st.floats(-0.6, 0.6)), min_size=1, max_size=30
)


@given(steps)
def test_euler_is_the_papers_sum_over_every_recorded_frame(rows):
    stamps_ns = 10**18 + np.cumsum([row[0] for row in rows])
    samples = samples_of(stamps_ns, [row[1] for row in rows], [row[2] for row in rows])
    position_m, yaw_rad = integrate_motion(samples, stamps_ns)
    expected = slow_euler(samples)
    np.testing.assert_allclose(np.column_stack([position_m, yaw_rad]), expected, atol=1e-9)


@pytest.mark.parametrize("integrator", ["euler", "arc"])
def test_images_on_their_own_clock_lie_between_the_motion_samples(integrator):
    stamps_ns = np.arange(0, 2_000_000_000, 10_000_000)
    samples = samples_of(stamps_ns, np.full(200, 10.0), np.full(200, 0.3))
    times_ns = np.array([205_000_000, 512_345_678, 1_777_000_001])
    position_m, yaw_rad = integrate_motion(samples, times_ns, integrator)
    seconds = (times_ns - times_ns[0]) * 1e-9
    np.testing.assert_allclose(yaw_rad, 0.3 * seconds, atol=1e-9)
    circle = np.column_stack([np.sin(0.3 * seconds), 1 - np.cos(0.3 * seconds)]) * (10.0 / 0.3)
    np.testing.assert_allclose(position_m, circle, atol=0.03 if integrator == "euler" else 1e-6)


def test_left_turn_goes_left():
    stamps_ns = np.arange(11) * 100_000_000
    position_m, yaw_rad = integrate_motion(samples_of(stamps_ns, [5] * 11, [0.5] * 11), stamps_ns)
    assert position_m[-1, 0] > 0
    assert position_m[-1, 1] > 0
    assert yaw_rad[-1] > 0


def test_first_time_is_the_origin_even_after_a_turn():
    stamps_ns = np.arange(21) * 100_000_000
    samples = samples_of(stamps_ns, [5] * 21, [0.5] * 10 + [0.0] * 11)
    position_m, yaw_rad = integrate_motion(samples, stamps_ns[10:])
    np.testing.assert_allclose(position_m[:, 0], np.arange(11) * 0.5, atol=1e-9)
    np.testing.assert_allclose(position_m[:, 1], 0, atol=1e-9)
    np.testing.assert_allclose(yaw_rad, 0, atol=1e-12)


def test_times_far_outside_the_motion_are_refused():
    motion = EgoMotion(samples_of([0, 10**8], [1, 1], [0, 0]))
    motion.check_cover(3 * 10**8)
    with pytest.raises(InputError, match=r"0\.400 s outside"):
        motion.check_cover(5 * 10**8)
    with pytest.raises(InputError, match="no motion samples"):
        EgoMotion().check_cover(0)


def test_nothing_moves_without_samples():
    assert EgoMotion().pose_at(5) == Pose(5, 0.0, 0.0, 0.0)


def test_a_speed_moves_over_the_time_after_its_sample_and_a_yaw_rate_turns_over_the_time_before():
    motion = EgoMotion(samples_of([0, 2 * S, 4 * S], [3.0, 0.0, 0.0], [99.0, 0.25, -0.5]))
    assert motion.pose_at(S) == Pose(S, 3.0, 0.0, 0.25)
    assert motion.pose_at(2 * S) == Pose(2 * S, 6.0, 0.0, 0.5)
    assert motion.pose_at(3 * S) == Pose(3 * S, 6.0, 0.0, 0.0)


def test_left_turn_leads_to_the_left():
    pose = EgoMotion(samples_of([0, S], [2.0, 2.0], [0.0, math.pi / 2])).pose_at(2 * S)
    assert (pose.x_m, pose.y_m) == pytest.approx((2.0, 2.0))


@pytest.mark.parametrize("integrator", ["euler", "arc"])
def test_rates_are_held_before_the_first_and_after_the_last_sample(integrator):
    motion = EgoMotion(samples_of([10 * S, 11 * S], [2.0, 4.0], [0.0, 0.0]), integrator)
    begin, end = motion.pose_at(10 * S), motion.pose_at(11 * S)
    assert begin.x_m - motion.pose_at(9 * S).x_m == pytest.approx(2.0)
    assert motion.pose_at(13 * S).x_m - end.x_m == pytest.approx(8.0)


@pytest.mark.parametrize("integrator", ["euler", "arc"])
@given(rows=steps)
def test_motion_known_up_to_now_leads_to_where_the_whole_of_it_does(integrator, rows):
    stamps_ns = np.cumsum([row[0] for row in rows])
    samples = samples_of(stamps_ns, [row[1] for row in rows], [row[2] for row in rows])
    whole, so_far = EgoMotion(samples, integrator), EgoMotion((), integrator)
    for sample in samples:
        so_far.add(sample)
        assert so_far.pose_at(sample.stamp_ns) == whole.pose_at(sample.stamp_ns)
