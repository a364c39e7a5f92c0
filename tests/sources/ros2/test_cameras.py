import cv2
import numpy as np
import pytest
from support.ros_messages import camera_info

from semgrid_eval.errors import InputError
from semgrid_eval.sources.rectification import baseline_m
from semgrid_eval.sources.ros2.cameras import Info, rectification_of

SIZE = (200, 120)
K = np.array([[150.0, 0.0, 97.0], [0.0, 152.0, 61.0], [0.0, 0.0, 1.0]])
LENS = (-0.25, 0.08, 0.001, -0.002, 0.0)


def info(**changes):
    return Info.of(camera_info(1, SIZE, K, **changes))


def test_distortion_is_undone():
    """A grid of dots, seen through the lens by OpenCV's own projection, comes back where the pinhole sees it."""
    rays = np.array([(x, y, 1.0) for x in np.linspace(-0.4, 0.4, 7) for y in np.linspace(-0.25, 0.25, 5)])
    bent, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(LENS))
    raw = np.zeros(SIZE[::-1], np.uint8)
    for u, v in bent[:, 0]:
        cv2.circle(raw, (round(u * 16), round(v * 16)), 40, 255, -1, cv2.LINE_AA, 4)
    rectification = rectification_of(info(d=LENS), rectified=False)
    assert rectification.changes
    straight = rectification.apply(raw, "bilinear")
    expected = (rays @ K.T)[:, :2]
    far_px = np.abs(bent[:, 0] - expected).max()
    assert far_px > 3
    for u, v in expected:
        column, row = round(u), round(v)
        part = straight[row - 5 : row + 6, column - 5 : column + 6].astype(float)
        rows, columns = np.mgrid[-5:6, -5:6]
        assert abs((part * columns).sum() / part.sum() + column - u) < 0.4
        assert abs((part * rows).sum() / part.sum() + row - v) < 0.4


def test_labels_are_moved_not_mixed():
    raw = np.full(SIZE[::-1], 7, np.uint8)
    raw[:, 100:] = 26
    assert set(np.unique(rectification_of(info(d=LENS), rectified=False).apply(raw, "nearest"))) <= {0, 7, 26}


@pytest.mark.parametrize(("rectified", "lens"), [(True, LENS), (False, ())])
def test_pictures_without_distortion_stay_untouched(rectified, lens):
    assert not rectification_of(info(d=lens), rectified=rectified).changes


def test_a_fisheye_is_undone_by_its_own_model():
    told = camera_info(1, SIZE, K, d=(0.1, -0.02, 0.0, 0.0))
    told.distortion_model = "equidistant"
    rectification = rectification_of(Info.of(told), rectified=False)
    rays = np.array([[[0.3, -0.2]]])
    bent = cv2.fisheye.distortPoints(rays, K, np.array([0.1, -0.02, 0.0, 0.0]))[0, 0]
    columns = np.tile(np.arange(SIZE[0], dtype=np.float32), (SIZE[1], 1))
    u, v = (K @ [0.3, -0.2, 1.0])[:2]
    assert rectification.apply(columns, "bilinear")[round(v), round(u)] == pytest.approx(bent[0], abs=0.6)


def test_lenses_that_are_not_known_are_refused():
    told = camera_info(1, SIZE, K, d=LENS)
    told.distortion_model = "omni"
    with pytest.raises(InputError, match="its lens is 'omni'; known are plumb_bob, rational_polynomial, equidistant"):
        rectification_of(Info.of(told), rectified=False)


def test_a_calibration_without_p_is_its_k_if_there_is_no_distortion():
    assert np.array_equal(info(p=False).projection(rectified=True)[:, :3], K)
    with pytest.raises(InputError, match="has distortion and no P, so the image is not rectified"):
        info(p=False, d=LENS).projection(rectified=True)


def test_the_baseline_is_that_of_both_projections():
    left, right = (info(shift_px=shift).projection(rectified=True) for shift in (0.0, -75.0))
    assert baseline_m(left, right) == 0.5
