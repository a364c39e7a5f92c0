"""The camera against arithmetic done by hand and against a slow intersection of rays and triangles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.cameras import calibration, slow_point

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.town.ground import Ground, Surface
from semgrid_eval.sources.town.sensors import NO_TRIANGLE, Camera, RayCaster, cityscapes_camera, look
from semgrid_eval.sources.town.solids import BOX, Soup, Texture, box, soup_of_boxes

ROAD = Ground(np.full((2000, 2000), Surface.ROAD, np.uint8), -200.0, -200.0)
POLE, BUILDING, SKY = LABEL_ID["pole"], LABEL_ID["building"], LABEL_ID["sky"]


def boxes(*rows) -> Soup:
    return soup_of_boxes(np.array(list(rows), BOX))


def pole_at(x_m: float, y_m: float, size_m: float = 0.2, height_m: float = 3.0, instance: int = 9) -> Soup:
    look_of = (POLE, int(Texture.PLAIN), (90, 90, 90))
    return boxes(box((x_m, y_m, 0.0), (0.0, height_m), (size_m, size_m), look_of, instance=instance))


def seen(camera: Camera, pose: Pose, soup: Soup, ground: Ground = ROAD, stage_m=(0.0, 0.0)):
    return look(camera, pose, (RayCaster(soup.moved(-stage_m[0], -stage_m[1]).triangles_m),), soup, ground, stage_m)


def test_the_camera_is_cityscapes_scaled_with_half_pixel_centres():
    full, quarter = cityscapes_camera(2048, 1024), cityscapes_camera(512, 256)
    assert (full.fx_px, full.fy_px, full.u0_px, full.v0_px) == (2262.0, 2265.0, 1096.0, 513.0)
    assert quarter.fx_px == pytest.approx(565.5)
    assert (quarter.u0_px + 0.5) * 4 == pytest.approx(1096.5)
    assert (quarter.v0_px + 0.5) * 4 == pytest.approx(513.5)


@given(
    u=st.integers(0, 63),
    v=st.integers(0, 31),
    depth_m=st.floats(1.0, 80.0),
    roll=st.floats(-0.1, 0.1),
    pitch=st.floats(-0.2, 0.2),
    yaw=st.floats(-0.5, 0.5),
)
def test_rays_are_those_of_the_camera_undone_step_by_step(u, v, depth_m, roll, pitch, yaw):
    camera = Camera(calibration(u0_px=31.5, v0_px=15.5, roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw), 64, 32)
    point = camera.origin_ego_m + depth_m * camera.rays_ego[v * 64 + u]
    assert tuple(point[:2]) == pytest.approx(slow_point(camera.calibration, u, v, depth_m), abs=1e-4)


def test_ground_pixels_lie_at_height_zero():
    camera = Camera(cityscapes_camera(256, 128), 256, 128)
    view = seen(camera, Pose(0, 30.0, -20.0, 2.0), boxes(), stage_m=(30.0, -20.0))
    ground = view.label == LABEL_ID["road"]
    assert ground.any()
    near = ground & (view.depth_m < 100.0)
    heights = camera.origin_ego_m[2] + view.depth_m[near] * camera.rays_ego[near, 2]
    assert np.abs(heights).max() < 1e-4
    assert np.abs(view.points_m[near, 2]).max() < 1e-4
    assert (np.isinf(view.depth_m) == (view.label == SKY)).all()
    assert (np.isinf(view.depth_m) == (camera.rays_ego[:, 2] >= 0)).all()
    assert (view.triangle == NO_TRIANGLE).all()


@pytest.mark.parametrize("yaw", [0.0, 1.1, -2.5])
@pytest.mark.parametrize("pitch", [-0.03, 0.038])
@pytest.mark.parametrize("left_m", [5.0, -5.0])
def test_a_pole_is_seen_at_the_pixel_and_depth_that_the_arithmetic_says(yaw, pitch, left_m):
    camera = Camera(calibration(pitch_rad=pitch, u0_px=255.5, v0_px=127.5), 512, 256)
    pose = Pose(0, 100.0, 50.0, yaw)
    ahead_m, height_m = 20.0, 1.5
    x_m = pose.x_m + ahead_m * math.cos(yaw) - left_m * math.sin(yaw)
    y_m = pose.y_m + ahead_m * math.sin(yaw) + left_m * math.cos(yaw)
    view = seen(camera, pose, pole_at(x_m, y_m), stage_m=(100.0, 50.0))
    away_m, aside_m, up_m = ahead_m - 1.7, left_m - 0.1, height_m - 1.22
    forward_m = away_m * math.cos(pitch) - up_m * math.sin(pitch)
    down_m = -(away_m * math.sin(pitch) + up_m * math.cos(pitch))
    u = round(255.5 - 565.0 * aside_m / forward_m)
    v = round(127.5 + 566.0 * down_m / forward_m)
    pixel = v * 512 + u
    assert view.label[pixel] == POLE
    assert view.instance[pixel] == 9
    assert view.depth_m[pixel] == pytest.approx(forward_m, abs=0.2)
    columns = np.unique(np.flatnonzero(view.label == POLE) % 512)
    assert columns.mean() == pytest.approx(255.5 - 565.0 * aside_m / forward_m, abs=1.0)


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_the_nearest_triangle_wins_as_in_a_slow_search(seed):
    rng = np.random.default_rng(seed)
    soup = boxes(
        *(
            box(
                (rng.uniform(4, 30), rng.uniform(-8, 8), rng.uniform(-3, 3)),
                (0.0, rng.uniform(0.5, 6)),
                (rng.uniform(0.5, 4), rng.uniform(0.5, 4)),
                (BUILDING, 0, (0, 0, 0)),
                instance=index + 1,
            )
            for index in range(5)
        )
    )
    camera = Camera(calibration(fx_px=30.0, fy_px=30.0, u0_px=15.5, v0_px=7.5), 32, 16)
    view = seen(camera, Pose(0, 0.0, 0.0, 0.0), soup)
    for pixel in rng.integers(0, 512, 12):
        depth_m = slow_depth(camera.origin_ego_m, camera.rays_ego[pixel].astype(np.float64), soup)
        expected = min(depth_m, float(camera.ground_depth_m[pixel]))
        assert view.depth_m[pixel] == pytest.approx(expected, rel=1e-3)


def slow_depth(origin, ray, soup: Soup) -> float:
    """Try every triangle; none hit is infinitely far."""
    best = math.inf
    for corners in soup.triangles_m.astype(np.float64):
        system = np.stack([ray, corners[0] - corners[1], corners[0] - corners[2]], axis=1)
        if abs(np.linalg.det(system)) > 1e-9:
            t, a, b = np.linalg.solve(system, corners[0] - origin)
            if t > 0 and a >= 0 and b >= 0 and a + b <= 1:
                best = min(best, t)
    return best


def test_several_casters_see_what_one_would():
    first, second = pole_at(15.0, 0.5, instance=1), pole_at(10.0, -0.1, instance=2)
    both = Soup.joined([first, second])
    camera = Camera(cityscapes_camera(256, 128), 256, 128)
    pose = Pose(0, 0.0, 0.0, 0.0)
    apart = look(camera, pose, (RayCaster(first.triangles_m), RayCaster(second.triangles_m)), both, ROAD)
    together = look(camera, pose, (RayCaster(both.triangles_m),), both, ROAD)
    np.testing.assert_array_equal(apart.triangle, together.triangle)
    np.testing.assert_array_equal(apart.instance, together.instance)
    assert set(np.unique(apart.instance)) == {0, 1, 2}


def test_the_ground_is_looked_up_in_the_map():
    surface = np.full((1000, 1000), Surface.SIDEWALK, np.uint8)
    surface[:, :500] = Surface.ROAD  # west of x = 100
    ground = Ground(surface, 0.0, 0.0)
    camera = Camera(cityscapes_camera(128, 64), 128, 64)
    north = seen(camera, Pose(0, 100.0, 100.0, math.pi / 2), boxes(), ground, stage_m=(100.0, 100.0))
    rows = north.label.reshape(64, 128)[40:]
    assert (rows[:, :60] == LABEL_ID["road"]).all()
    assert (rows[:, 76:] == LABEL_ID["sidewalk"]).all()
    west = seen(camera, Pose(0, 99.0, 100.0, math.pi), boxes(), ground, stage_m=(100.0, 100.0))
    assert (west.label.reshape(64, 128)[40:] == LABEL_ID["road"]).all()


def test_beyond_the_map_is_terrain():
    ground = Ground(np.full((10, 10), Surface.ROAD, np.uint8), 0.0, 0.0)
    surfaces = ground.at(np.array([-0.1, 0.1, 1.9, 2.1]), np.array([1.0, 1.0, 1.0, 1.0]))
    assert surfaces.tolist() == [Surface.TERRAIN, Surface.ROAD, Surface.ROAD, Surface.TERRAIN]


def test_disparity_is_focal_length_times_baseline_over_depth():
    camera = Camera(cityscapes_camera(512, 256), 512, 256)
    found = camera.disparity_px(np.array([10.0, np.inf], np.float32))
    assert found.tolist() == pytest.approx([565.5 * 0.209 / 10.0, 0.0])
