import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.ros_messages import transforms

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3
from semgrid_eval.sources.ros2.transforms import Transforms

ANGLE = st.floats(-0.7, 0.7)
PLACE = st.tuples(*[st.floats(-3, 3)] * 3)


@given(ANGLE, ANGLE, PLACE, PLACE)
def test_links_are_followed_both_ways(yaw, pitch, first, second):
    known = Transforms()
    up, down = SE3.from_roll_pitch_yaw(0.1, pitch, 0.0, first), SE3.from_roll_pitch_yaw(0.0, 0.2, yaw, second)
    known.add(transforms(("rig", "base_link", up.rotation, first), ("/rig", "camera", down.rotation, second)))
    found, expected = known.lookup("base_link", "camera"), up.inverse() @ down
    assert np.allclose(found.rotation, expected.rotation, atol=1e-9)
    assert np.allclose(found.translation_m, expected.translation_m, atol=1e-9)


def test_what_is_not_linked_is_said_with_what_is():
    known = Transforms()
    known.add(transforms(("base_link", "imu", np.eye(3), (0, 0, 0)), ("head", "camera", np.eye(3), (0, 0, 0))))
    with pytest.raises(InputError, match="no link from base_link to camera; there are: base_link -> imu, head -> cam"):
        known.lookup("base_link", "camera")


def test_links_elsewhere_may_move():
    known = Transforms()
    for x in (0.0, 5.0):
        known.add(
            transforms(("odom", "base_link", np.eye(3), (x, 0, 0)), ("base_link", "camera", np.eye(3), (1, 0, 0)))
        )
    assert known.lookup("base_link", "camera").translation_m[0] == 1
    with pytest.raises(InputError, match="the link odom -> base_link moves"):
        known.lookup("odom", "camera")


def test_static_transforms_count_even_where_they_come_late():
    known = Transforms()
    for x, rank in ((0.0, 1), (0.5, 1), (1.0, 0), (7.0, 1)):
        known.add(transforms(("base_link", "camera", np.eye(3), (x, 0, 0))), rank)
    assert known.lookup("base_link", "camera").translation_m[0] == 1


def test_a_rotation_by_nothing_is_refused():
    message = transforms(("a", "b", np.eye(3), (0, 0, 0)))
    message.transforms[0].transform.rotation.w = 0.0
    with pytest.raises(InputError, match=r"quaternion: \(0, 0, 0, 0\) is not a rotation"):
        Transforms().add(message)
