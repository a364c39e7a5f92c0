"""The spinning LiDAR against geometry by hand, and its errors against their own statistics."""

import math

import numpy as np
import pytest
from support.lidar_rooms import MOUNT, empty, scenery, wall

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.town.lidar import (
    ELEVATIONS_RAD,
    RANGE_M,
    STEP_M,
    Lidar,
    LidarErrors,
    LidarNoise,
    reflectances,
)
from semgrid_eval.sources.town.noise import LabelNoise
from semgrid_eval.sources.town.solids import Texture

LIDAR = Lidar(MOUNT, columns=256)
ROAD, BUILDING, CAR, SKY = (LABEL_ID[name] for name in ("road", "building", "car", "sky"))
HEIGHT_M = MOUNT.place_m[2]
NO_LABEL_NOISE = LabelNoise(warp_px=0.0, border_px=0.0, bad_borders=0.0, confused=0.0, mistaken=0.0)
NOTHING_WRONG = {"range_m": 0.0, "lost": 0.0, "lost_in_glass": 0.0, "reach": 0.0, "intensity": 0.0}


def swept(soup, noise=None, seed=0, pose=None):
    """What the LiDAR sees of a soup on a road, and its sweep."""
    shown = scenery(soup, pose or Pose(0, 0.0, 0.0, 0.0))
    view = shown.seen_by(LIDAR)
    return view, LidarErrors(LIDAR, noise, np.random.default_rng(seed)).sweep(7, view, soup)


def noise(**changes):
    return LidarNoise(**{**NOTHING_WRONG, "label": NO_LABEL_NOISE, **changes})


def test_it_has_the_rings_of_the_device():
    degrees = np.degrees(ELEVATIONS_RAD)
    assert len(degrees) == 64
    assert (degrees[0], degrees[31], degrees[32], degrees[63]) == pytest.approx(
        (2.0, -8.333, -8.833, -24.333), abs=1e-3
    )
    assert np.all(np.diff(degrees) < 0)
    np.testing.assert_allclose(np.linalg.norm(LIDAR.rays, axis=1), 1.0, atol=1e-6)
    azimuths = np.unwrap(np.arctan2(LIDAR.rays[:256, 1], LIDAR.rays[:256, 0]))
    np.testing.assert_allclose(np.diff(azimuths), -math.tau / 256, atol=1e-5)


def test_rings_on_the_ground_have_the_radius_that_their_angle_says():
    _, sweep = swept(empty())
    radii = np.linalg.norm(sweep.points_m[:, :2], axis=1)
    expected = HEIGHT_M / np.tan(-ELEVATIONS_RAD[ELEVATIONS_RAD < 0])
    expected = expected[HEIGHT_M / np.sin(-ELEVATIONS_RAD[ELEVATIONS_RAD < 0]) <= RANGE_M[1]]
    found = np.sort(radii.reshape(-1, 256).mean(axis=1))
    np.testing.assert_allclose(found, np.sort(expected), atol=2 * STEP_M)
    np.testing.assert_allclose(sweep.points_m[:, 2], -HEIGHT_M, atol=STEP_M)
    assert (sweep.label_id == ROAD).all()
    assert found[0] == pytest.approx(1.73 / math.tan(math.radians(24.333)), abs=0.01)


@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
def test_a_wall_is_as_far_as_it_is_whichever_way_the_vehicle_points(yaw_rad):
    ahead = (10.0 * math.cos(yaw_rad), 10.0 * math.sin(yaw_rad), yaw_rad)
    _, sweep = swept(wall(*ahead, BUILDING), pose=Pose(0, 0.0, 0.0, yaw_rad))
    in_vehicle = sweep.mount.ego_from_sensor.apply(sweep.points_m.astype(np.float64))
    on_wall = sweep.label_id == BUILDING
    assert on_wall.sum() > 500
    np.testing.assert_allclose(in_vehicle[on_wall, 0], 9.5, atol=0.01)  # it is a metre thick
    assert np.abs(in_vehicle[on_wall, 1]).max() < 10.01
    ring = np.argmin(np.abs(ELEVATIONS_RAD + math.radians(2.0)))
    reached = 9.5 - MOUNT.place_m[0]
    ahead_of_it = in_vehicle[on_wall & (np.abs(in_vehicle[:, 1]) < 0.2)]
    height_m = HEIGHT_M + reached * math.tan(ELEVATIONS_RAD[ring])
    assert np.abs(ahead_of_it[:, 2] - height_m).min() < 0.02


@pytest.mark.parametrize(("at_m", "seen"), [(100.0, True), (130.0, False)])
def test_nothing_is_measured_farther_than_the_device_can(at_m, seen):
    _, sweep = swept(wall(at_m, 0.0, 0.0, BUILDING))
    assert (sweep.label_id == BUILDING).any() == seen


def test_nothing_is_measured_nearer_than_the_device_can():
    view, sweep = swept(wall(2.2, 0.0, 0.0, BUILDING))  # its front is .75 m ahead of the device
    assert view.depth_m.min() < RANGE_M[0]
    assert np.linalg.norm(sweep.points_m, axis=1).min() >= RANGE_M[0] - STEP_M


def test_an_exact_sweep_is_what_is_seen():
    view, sweep = swept(wall(15.0, 0.0, 0.0, BUILDING))
    seen = (view.depth_m <= RANGE_M[1]) & (view.depth_m >= RANGE_M[0])
    np.testing.assert_array_equal(sweep.label_id, view.label[seen])
    np.testing.assert_allclose(np.linalg.norm(sweep.points_m, axis=1), view.depth_m[seen], atol=STEP_M)
    assert (sweep.stamp_ns, sweep.mount) == (7, MOUNT)


def test_ranges_have_the_noise_that_is_asked_for():
    _, exact = swept(wall(15.0, 0.0, 0.0, BUILDING), noise())
    _, noisy = swept(wall(15.0, 0.0, 0.0, BUILDING), noise(range_m=0.05))
    errors_m = np.linalg.norm(noisy.points_m, axis=1) - np.linalg.norm(exact.points_m, axis=1)
    assert errors_m.std() == pytest.approx(0.05, rel=0.05)
    assert abs(errors_m.mean()) < 0.002
    across = np.cross(noisy.points_m, exact.points_m)
    assert np.abs(across).max() / 15.0**2 < 0.01, "along the ray"


def test_points_are_lost_at_random_and_on_glass_more():
    soup = wall(8.0, 0.0, 0.0, CAR, Texture.GLASS)
    view, sweep = swept(soup, noise(lost=0.1, lost_in_glass=0.6))
    for label, lost in ((CAR, 0.6), (ROAD, 0.1)):
        near = (view.label == label) & (view.depth_m < 20.0)
        came_back = (np.linalg.norm(sweep.points_m, axis=1) < 20.0) & (sweep.label_id == label)
        assert 1.0 - came_back.sum() / near.sum() == pytest.approx(lost, abs=0.03)


@pytest.mark.parametrize(("level", "sees_m", "loses_m"), [(10, 30, 45), (110, 55, 75), (235, 110, None)])
def test_dark_surfaces_are_lost_sooner_than_bright_ones(level, sees_m, loses_m):
    for at_m, seen in ((sees_m, True), (loses_m, False)):
        if at_m is not None:
            _, sweep = swept(wall(at_m, 0.0, 0.0, CAR, colour=(level, level, level)), noise())
            assert (sweep.label_id == CAR).any() == seen


def test_pavement_is_lost_at_the_range_that_the_manual_says():
    _, sweep = swept(empty(), noise())
    assert 45.0 < np.linalg.norm(sweep.points_m, axis=1).max() < 55.0


def test_the_share_of_light_is_that_of_the_colour_and_green_is_bright():
    def of(label, colour):
        soup = wall(10.0, 0.0, 0.0, label, colour=colour)
        view = scenery(soup, Pose(0, 0.0, 0.0, 0.0)).seen_by(LIDAR)
        return float(reflectances(view, soup)[view.label == label].mean())

    assert of(CAR, (255, 255, 255)) == pytest.approx(1.0, abs=1e-3)
    assert of(CAR, (188, 188, 188)) == pytest.approx(0.5, abs=0.01)  # the middle of linear light in sRGB
    assert of(LABEL_ID["vegetation"], (10, 20, 10)) == 0.5


def test_labels_are_mistaken_in_patches_and_nothing_is_taken_for_sky():
    soup = wall(15.0, 0.0, 0.0, LABEL_ID["fence"])
    shares, exact = [], (swept(soup, noise())[1].label_id == LABEL_ID["fence"]).mean()
    for seed in range(8):
        label = LabelNoise(warp_px=0.0, border_px=0.0, bad_borders=0.0, confused=0.0, mistaken=0.5)
        _, sweep = swept(soup, noise(label=label), seed)
        shares.append((sweep.label_id == LABEL_ID["fence"]).mean() / exact)
        assert SKY not in sweep.label_id
    assert 1.0 - np.mean(shares) == pytest.approx(0.15, abs=0.1)  # half of the 30 % of `noise.py`
    _, bent = swept(soup, noise(label=LabelNoise(warp_px=2.0, confused=0.0, mistaken=0.0)))
    assert SKY not in bent.label_id
    changed = swept(soup, noise())[1].label_id != bent.label_id
    assert 0 < changed.sum() < 0.1 * len(changed)


def test_mistakes_stay_from_sweep_to_sweep_and_dropouts_do_not():
    soup = wall(15.0, 0.0, 0.0, LABEL_ID["fence"])
    errors = LidarErrors(LIDAR, noise(label=LabelNoise(mistaken=1.5)), np.random.default_rng(3))
    view = scenery(soup, Pose(0, 0.0, 0.0, 0.0)).seen_by(LIDAR)
    first, second = (errors.sweep(stamp, view, soup).label_id == LABEL_ID["fence"] for stamp in (0, 1))
    assert np.corrcoef(first, second)[0, 1] > 0.7
    lossy = LidarErrors(LIDAR, noise(lost=0.3), np.random.default_rng(3))
    kept = [{tuple(point) for point in lossy.sweep(stamp, view, soup).points_m.tolist()} for stamp in (0, 1)]
    assert len(kept[0] & kept[1]) / len(kept[0]) == pytest.approx(0.7, abs=0.03)


def test_the_same_random_numbers_give_the_same_sweep():
    soup = wall(15.0, 0.0, 0.0, BUILDING)
    one, same, other = (swept(soup, LidarNoise(), seed)[1] for seed in (1, 1, 2))
    assert one.points_m.tobytes() == same.points_m.tobytes() != other.points_m.tobytes()
    assert one.label_id.tobytes() == same.label_id.tobytes()
    assert one.intensity.tobytes() == same.intensity.tobytes()
