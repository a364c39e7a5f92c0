import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.geometry import CAMERA_FROM_OPTICAL, SE3
from semgrid_eval.recording.types import CameraCalibration

ANGLE = st.floats(-0.7, 0.7)
PLACE = st.tuples(*[st.floats(-3, 3)] * 3)


@given(ANGLE, ANGLE, ANGLE, PLACE)
def test_place_and_angles_of_a_camera_come_back(roll, pitch, yaw, place):
    ego_from_camera = SE3.from_roll_pitch_yaw(roll, pitch, yaw, place)
    found = CameraCalibration.of(np.eye(3), ego_from_camera @ CAMERA_FROM_OPTICAL, None)
    assert (found.roll_rad, found.pitch_rad, found.yaw_rad) == pytest.approx((roll, pitch, yaw), abs=1e-9)
    assert (found.x_m, found.y_m, found.z_m) == pytest.approx(place, abs=1e-12)
