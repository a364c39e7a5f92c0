import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cameras import calibration, slow_point

from semgrid_eval.classes import NO_POINT
from semgrid_eval.sensors.projection import Projection, ground_slope, unit_projection

angle = st.floats(-0.5, 0.5)


@given(angle, angle, angle, st.floats(0.5, 90.0), st.integers(0, 31), st.integers(0, 15))
def test_rays_match_the_camera_undone_step_by_step(roll, pitch, yaw, depth_m, u, v):
    camera = calibration(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw, fx_px=35.0, fy_px=36.0, u0_px=16.3, v0_px=7.9)
    slope = ground_slope(camera, (32, 16), (32, 16))
    point = np.array([camera.x_m, camera.y_m]) + depth_m * slope[:, v, u]
    np.testing.assert_allclose(point, slow_point(camera, u, v, depth_m), rtol=1e-9, atol=1e-9)


def test_camera_axes_without_rotation_are_forward_left():
    slope = ground_slope(calibration(), (512, 256), (512, 256))
    assert slope[0, 0, 0] == 1.0
    assert slope[1, 100, 0] > 0  # a pixel at the left edge lies left
    assert slope[1, 100, 511] < 0


def test_half_size_image_looks_where_the_full_one_does():
    camera = calibration()
    full = ground_slope(camera, (512, 256), (512, 256))
    half = ground_slope(camera, (512, 256), (256, 128))
    between = (full[:, 0::2, 0::2] + full[:, 1::2, 1::2]) / 2
    np.testing.assert_allclose(half, between, atol=1e-12)


@pytest.mark.parametrize("size_px", [(8, 6), (4, 3), (16, 12)])
def test_points_match_a_pixel_by_pixel_twin(size_px):
    camera = calibration(fx_px=8.0, fy_px=8.1, u0_px=3.9, v0_px=2.8, pitch_rad=0.1, yaw_rad=-0.3)
    random = np.random.default_rng(3)
    label, disparity = random.integers(0, 34, (6, 8)).astype(np.uint8), random.integers(0, 400, (6, 8), np.uint16)
    disparity[0] = [0, 1, 2, 3, 0, 1, 2, 3]
    table = random.choice([1, 5, 9, NO_POINT], 256).astype(np.uint8)
    found = Projection(camera, size_px, table).points(disparity, label)
    for row in range(size_px[1]):
        for column in range(size_px[0]):
            u, v = (column + 0.5) * 8 / size_px[0], (row + 0.5) * 6 / size_px[1]
            value, known = int(disparity[int(v), int(u)]), table[label[int(v), int(u)]]
            assert found.class_id[row, column] == (NO_POINT if value <= 1 else known)
            if found.class_id[row, column] != NO_POINT:
                depth_m = camera.fx_px * camera.baseline_m / ((value - 1) / 256)
                point = (found.forward_m[row, column], found.left_m[row, column])
                assert point == pytest.approx(slow_point(camera, u - 0.5, v - 0.5, depth_m))


@given(angle, angle, angle, st.floats(0.5, 90.0))
def test_points_are_projected_back_to_their_pixels(roll, pitch, yaw, depth_m):
    camera = calibration(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    u, v = 100, 30
    optical_m = depth_m * np.array([(u - camera.u0_px) / camera.fx_px, (v - camera.v0_px) / camera.fy_px, 1.0])
    point_m = camera.ego_from_optical.apply(optical_m)
    assert point_m[:2] == pytest.approx(slow_point(camera, u, v, depth_m))
    across, down, depth = unit_projection(camera, (512, 256)) @ [*point_m, 1.0]
    assert (across / depth * 512 - 0.5, down / depth * 256 - 0.5, depth) == pytest.approx((u, v, depth_m))
