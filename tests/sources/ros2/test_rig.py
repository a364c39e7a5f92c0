import cv2
import numpy as np
import pytest
from support.bags import OPTICAL, camera_info, image, matrix
from support.toy_world import HEIGHT, WIDTH, ToyWorld

from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sources.matching import SemiGlobalMatching
from semgrid_eval.sources.ros2.cameras import Info
from semgrid_eval.sources.ros2.mapping import CameraMap
from semgrid_eval.sources.ros2.rig import Rig, RigPlan

CALIBRATION = ToyWorld().calibration()
K = matrix(CALIBRATION)
MAP = CameraMap(image="/left", info="/left_info", rectified=True, right="/right", right_info="/right_info")


def pair(disparity_px):
    """A texture on a plane, as both cameras see it."""
    noise = np.random.default_rng(2).normal(size=(HEIGHT, WIDTH))
    left = np.clip(128 + 200 * cv2.GaussianBlur(noise, (0, 0), 1.2), 0, 255).astype(np.uint8)
    shift = np.array([[1.0, 0.0, -disparity_px], [0.0, 1.0, 0.0]])
    right = cv2.warpAffine(left, shift, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    return left, np.asarray(right, np.uint8)


def rig(right_k=K):
    infos = [Info.of(camera_info(1, (WIDTH, HEIGHT), each)) for each in (K, right_k)]
    return Rig(RigPlan(MAP, CALIBRATION, *infos))


def matched(left, right, **changes):
    found = rig(**changes).frame(
        1, {"image": image(1, left, "mono8"), "right": image(1, right, "mono8", frame=OPTICAL)}
    )
    return decoded_disparity(decode_gray(found.disparity_png, bit_depth=16))


def test_a_right_image_is_matched_as_the_town_matches():
    left, right = pair(7.5)
    found, expected = matched(left, right), SemiGlobalMatching(CALIBRATION).disparity_px(left, right)
    inside = found[10:-10, 60:-10]
    assert (inside > 0).mean() > 0.9
    assert np.median(inside[inside > 0]) == pytest.approx(7.5, abs=0.1)
    assert np.array_equal(found, expected)


def test_principal_points_that_differ_are_no_distance():
    left, right = pair(7.5)
    shifted = K.copy()
    shifted[0, 2] += 2.5  # what is infinitely far is 2.5 px farther right in the right image
    found = matched(left, np.roll(right, 0, axis=1), right_k=shifted)[10:-10, 60:-10]
    assert np.median(found[found > 0]) == pytest.approx(7.5 + 2.5, abs=0.1)
