import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from semgrid_eval.grids.motion import integrate_motion

from semgrid_eval.errors import InputError
from semgrid_eval.recording.types import MotionSample


def samples_of(stamps_ns, speeds, yaw_rates):
    return [MotionSample(int(t), float(v), float(w)) for t, v, w in zip(stamps_ns, speeds, yaw_rates, strict=True)]


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


def test_frames_far_outside_the_motion_are_refused():
    samples = samples_of([0, 10**8], [1, 1], [0, 0])
    with pytest.raises(InputError, match=r"0\.400 s outside"):
        integrate_motion(samples, np.array([0, 5 * 10**8]))
    with pytest.raises(InputError, match="no motion samples"):
        integrate_motion([], np.array([0]))
