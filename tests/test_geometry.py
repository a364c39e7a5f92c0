import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, SE2, SE3

metres, angle = st.floats(-50, 50), st.floats(-7, 7)
planar = st.builds(SE2, metres, metres, angle)
spatial = st.builds(SE3.from_roll_pitch_yaw, angle, angle, angle, st.tuples(metres, metres, metres))
POINTS_M = np.array([[1.0, 2.0, -1.0], [-3.0, 0.5, 4.0], [0.0, 0.0, 0.0]])


def test_a_turn_to_the_left_comes_before_the_way():
    there = SE2(10.0, 1.0, math.pi / 2)
    np.testing.assert_allclose(there.apply(np.array([[2.0, 0.0], [0.0, 1.0]])), [[10.0, 3.0], [9.0, 1.0]])


@given(planar, planar)
def test_chained_transforms_of_the_plane_act_one_after_the_other(a_from_b, b_from_c):
    points_m = POINTS_M[:, :2]
    chained = (a_from_b @ b_from_c).apply(points_m)
    np.testing.assert_allclose(chained, a_from_b.apply(b_from_c.apply(points_m)), atol=1e-9)
    np.testing.assert_allclose(a_from_b.inverse().apply(a_from_b.apply(points_m)), points_m, atol=1e-9)
    seen, slow = b_from_c.seen_from(a_from_b), a_from_b.inverse() @ b_from_c
    assert (seen.x_m, seen.y_m, seen.yaw_rad) == pytest.approx((slow.x_m, slow.y_m, slow.yaw_rad), abs=1e-9)


@given(spatial, spatial)
def test_chained_transforms_of_space_act_one_after_the_other(a_from_b, b_from_c):
    chained = (a_from_b @ b_from_c).apply(POINTS_M)
    np.testing.assert_allclose(chained, a_from_b.apply(b_from_c.apply(POINTS_M)), atol=1e-9)
    np.testing.assert_allclose(a_from_b.inverse().apply(a_from_b.apply(POINTS_M)), POINTS_M, atol=1e-9)


def about(axis, angle_rad):
    """A rotation about one axis, by turning the other two."""
    rotation = np.eye(3)
    first, second = [i for i in range(3) if i != axis]
    sign = -1 if axis == 1 else 1
    rotation[first, first] = rotation[second, second] = math.cos(angle_rad)
    rotation[second, first], rotation[first, second] = sign * math.sin(angle_rad), -sign * math.sin(angle_rad)
    return rotation


@given(angle, angle, angle)
def test_roll_comes_first_and_yaw_last(roll, pitch, yaw):
    rotation = SE3.from_roll_pitch_yaw(roll, pitch, yaw).rotation
    np.testing.assert_allclose(rotation, about(2, yaw) @ about(1, pitch) @ about(0, roll), atol=1e-12)


def test_positive_pitch_looks_down_positive_yaw_looks_left_and_positive_roll_lifts_the_left():
    forward, left = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    assert SE3.from_roll_pitch_yaw(0, 0.1, 0).apply(forward)[2] < 0
    assert SE3.from_roll_pitch_yaw(0, 0, 0.1).apply(forward)[1] > 0
    assert SE3.from_roll_pitch_yaw(0.1, 0, 0).apply(left)[2] > 0


def test_optical_axes_are_right_down_forward():
    np.testing.assert_array_equal(CAMERA_FROM_OPTICAL.apply(np.array([1.0, 2.0, 3.0])), [3.0, -1.0, -2.0])
