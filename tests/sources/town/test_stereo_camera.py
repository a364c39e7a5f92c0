import cv2
import numpy as np
import pytest
from support.cameras import calibration

from semgrid_eval.sources.town.sensors import Camera, cityscapes_camera
from semgrid_eval.sources.town.stereo_camera import StereoMatcher, right_of

CAMERA = Camera(cityscapes_camera(512, 256), 512, 256)


def textured(height: int, width: int):
    noise = np.random.default_rng(0).standard_normal((height, width, 1), np.float32)
    blurred = cv2.GaussianBlur(noise, (0, 0), 1.2)
    grey = np.clip(128 + 60 * blurred / blurred.std(), 0, 255)
    return np.repeat(grey.reshape(height, width, 1), 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize("disparity_px", [4.0, 11.5, 23.25])
def test_a_plane_is_matched_over_the_whole_picture(disparity_px):
    matcher = StereoMatcher(CAMERA, np.random.default_rng(1))
    height, width = matcher.cameras[0].height_px, matcher.cameras[0].width_px
    left = textured(height, width)
    shift = np.float32([[1, 0, -disparity_px], [0, 1, 0]])
    right = cv2.warpAffine(left, shift, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    found = matcher.disparity_px(left, right)
    assert found.shape == (256, 512)
    inner = found[8:-8, :480]
    assert (inner > 0).mean() > 0.95
    assert np.median(inner[inner > 0]) == pytest.approx(disparity_px, abs=0.15)


def test_where_there_is_nothing_to_match_little_is_found():
    matcher = StereoMatcher(CAMERA, np.random.default_rng(1))
    plain = np.full((256, matcher.cameras[0].width_px, 3), 128, np.uint8)
    assert (matcher.disparity_px(plain, plain) > 0).mean() < 0.7


def test_the_pair_is_the_camera_with_a_margin_and_its_right_neighbour():
    matcher = StereoMatcher(CAMERA, np.random.default_rng(1))
    left, right = matcher.cameras
    assert left.width_px == 512 + matcher.margin_px
    np.testing.assert_allclose(
        left.rays_ego.reshape(256, -1, 3)[:, matcher.margin_px :], CAMERA.rays_ego.reshape(256, 512, 3), atol=1e-6
    )
    assert matcher.margin_px >= CAMERA.disparity_px(np.float32([3.0]))[0]
    assert right.calibration.y_m < left.calibration.y_m


def test_the_right_camera_is_a_baseline_away_along_the_rows():
    camera = Camera(calibration(roll_rad=0.05, pitch_rad=0.1, yaw_rad=0.3), 64, 32)
    away_m = camera.calibration.ego_from_optical.rotation.T @ (right_of(camera).origin_ego_m - camera.origin_ego_m)
    assert away_m == pytest.approx([0.209, 0.0, 0.0], abs=1e-12)
