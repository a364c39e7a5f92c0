import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.driving import CALIBRATION, START_NS

from semgrid_eval.log import codec
from semgrid_eval.recording.types import CameraCalibration, MotionSample, Pose

ANGLES = st.floats(-3.0, 3.0)


def turned(axis, angle_rad):
    """Rotation matrix about x, y or z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def matrix_of(q):
    """Rotation matrix of a quaternion."""
    return np.array(
        [
            [1 - 2 * (q.y**2 + q.z**2), 2 * (q.x * q.y - q.z * q.w), 2 * (q.x * q.z + q.y * q.w)],
            [2 * (q.x * q.y + q.z * q.w), 1 - 2 * (q.x**2 + q.z**2), 2 * (q.y * q.z - q.x * q.w)],
            [2 * (q.x * q.z - q.y * q.w), 2 * (q.y * q.z + q.x * q.w), 1 - 2 * (q.x**2 + q.y**2)],
        ]
    )


def camera_transform(**angles):
    values = {name: getattr(CALIBRATION, name) for name in CameraCalibration.__dataclass_fields__}
    calibration = CameraCalibration(**{**values, "roll_rad": 0.0, "pitch_rad": 0.0, "yaw_rad": 0.0, **angles})
    return codec.transforms_message(Pose(START_NS, 0.0, 0.0, 0.0), {"front": calibration}).transforms[2]


@given(ANGLES, ANGLES, ANGLES)
def test_camera_rotation_is_yaw_pitch_roll_after_the_change_of_axes(roll, pitch, yaw):
    rotation = matrix_of(camera_transform(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw).rotation)
    forward_left_up_from_right_down_forward = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    expected = turned(2, yaw) @ turned(1, pitch) @ turned(0, roll) @ forward_left_up_from_right_down_forward
    assert rotation == pytest.approx(expected, abs=1e-12)


def test_camera_looks_ahead_down_with_pitch_and_left_with_yaw():
    optical_axis = np.array([0, 0, 1])
    assert matrix_of(camera_transform().rotation) @ optical_axis == pytest.approx([1, 0, 0])
    assert (matrix_of(camera_transform(pitch_rad=0.1).rotation) @ optical_axis)[2] < 0
    assert (matrix_of(camera_transform(yaw_rad=0.1).rotation) @ optical_axis)[1] > 0


def test_camera_stands_where_the_calibration_says():
    place = camera_transform().translation
    assert (place.x, place.y, place.z) == (CALIBRATION.x_m, CALIBRATION.y_m, CALIBRATION.z_m)


@given(st.integers(0, 2**62))
def test_time_stamps_are_exact_to_the_nanosecond(stamp_ns):
    stamp = codec.timestamp(stamp_ns)
    assert codec.stamp_ns(stamp) == stamp_ns
    assert 0 <= stamp.nanos < 10**9


@given(st.floats(allow_nan=False), st.floats(allow_nan=False), st.none() | st.floats(allow_nan=False))
def test_motion_is_exact(speed, yaw_rate, heading):
    sample = MotionSample(START_NS, speed, yaw_rate, heading_deg=heading)
    assert codec.read_motion(codec.motion_message(sample).SerializeToString()) == sample


@given(ANGLES)
def test_yaw_of_a_pose_comes_back(yaw_rad):
    pose = Pose(START_NS, -3.5, 2.25, yaw_rad)
    read = codec.read_pose(codec.pose_message(pose, "map").SerializeToString())
    assert (read.x_m, read.y_m, read.stamp_ns) == (-3.5, 2.25, START_NS)
    assert read.yaw_rad == pytest.approx(yaw_rad, abs=1e-12)
