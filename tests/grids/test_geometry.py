import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from semgrid_eval.grids.geometry import ego_from_camera, ground_rays, nearest_indices
from support.cameras import calibration, slow_point

angle = st.floats(-0.5, 0.5)


@given(angle, angle, angle, st.floats(0.5, 90.0), st.integers(0, 31), st.integers(0, 15))
def test_rays_match_the_camera_undone_step_by_step(roll, pitch, yaw, depth_m, u, v):
    camera = calibration(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw, fx_px=35.0, fy_px=36.0, u0_px=16.3, v0_px=7.9)
    rays = ground_rays(camera, (32, 16), (32, 16))
    point = rays.origin_m + depth_m * rays.slope[:, v, u]
    np.testing.assert_allclose(point, slow_point(camera, u, v, depth_m), rtol=1e-9, atol=1e-9)


def test_camera_axes_without_rotation_are_forward_left():
    rays = ground_rays(calibration(), (512, 256), (512, 256))
    assert rays.slope[0, 0, 0] == 1.0
    assert rays.slope[1, 100, 0] > 0  # a pixel at the left edge lies left
    assert rays.slope[1, 100, 511] < 0


def test_positive_pitch_looks_down_and_positive_yaw_looks_left():
    forward = np.array([1.0, 0.0, 0.0])
    assert (ego_from_camera(calibration(pitch_rad=0.1)) @ forward)[2] < 0
    assert (ego_from_camera(calibration(yaw_rad=0.1)) @ forward)[1] > 0
    left = np.array([0.0, 1.0, 0.0])
    assert (ego_from_camera(calibration(roll_rad=0.1)) @ left)[2] > 0


def test_half_size_image_looks_where_the_full_one_does():
    camera = calibration()
    full = ground_rays(camera, (512, 256), (512, 256))
    half = ground_rays(camera, (512, 256), (256, 128))
    between = (full.slope[:, 0::2, 0::2] + full.slope[:, 1::2, 1::2]) / 2
    np.testing.assert_allclose(half.slope, between, atol=1e-12)


@pytest.mark.parametrize(("source", "target"), [(2048, 512), (1241, 512), (376, 256), (100, 256), (7, 7)])
def test_nearest_indices_pick_the_closest_centre(source, target):
    centres = (np.arange(target) + 0.5) / target
    distance = np.abs((np.arange(source) + 0.5) / source - centres[:, None])
    picked = nearest_indices(source, target)
    np.testing.assert_allclose(distance[np.arange(target), picked], distance.min(axis=1), atol=1e-12)
