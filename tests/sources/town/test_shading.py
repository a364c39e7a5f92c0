"""The colour image against the same arithmetic on whole arrays, and what light and shadow must do to it."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.town import shading
from semgrid_eval.sources.town.ground import SURFACE_COLOURS, Ground, Surface
from semgrid_eval.sources.town.sensors import NO_TRIANGLE, Camera, RayCaster, cityscapes_camera, look
from semgrid_eval.sources.town.shading import Painter, Sunlight
from semgrid_eval.sources.town.solids import BOX, Soup, Texture, box, soup_of_boxes

WIDTH, HEIGHT = 160, 80
SUN = Sunlight(azimuth_rad=2.0, elevation_rad=0.6, overcast=0.15)
POSE = Pose(0, 0.0, 0.0, 0.0)
MIXED = Ground(np.random.default_rng(1).integers(0, len(Surface), (2000, 2000)).astype(np.uint8), -200.0, -200.0)
TERRAIN = Ground(np.full((2000, 2000), Surface.TERRAIN, np.uint8), -200.0, -200.0)


def street(textures=tuple(Texture)) -> Soup:
    """A box of each texture side by side, each turned another way."""
    rows = []
    for position, texture in enumerate(textures):
        colour = (60 + 30 * position, 200 - 25 * position, 90)
        placed = (20.0, 3.0 * position - 7.5, 0.3 + position)
        rows.append(box(placed, (0.0, 3.5), (2.0, 2.5), (LABEL_ID["building"], int(texture), colour)))
    return soup_of_boxes(np.array(rows, BOX))


def scene(ground: Ground, still: Soup, movers: Soup, sunlight: Sunlight = SUN) -> SimpleNamespace:
    camera, soup = Camera(cityscapes_camera(WIDTH, HEIGHT), WIDTH, HEIGHT), Soup.joined([still, movers])
    casters = (RayCaster(still.triangles_m), RayCaster(movers.triangles_m))
    view = look(camera, POSE, casters, soup, ground)
    painter = Painter(camera, sunlight, still)
    return SimpleNamespace(view=view, soup=soup, paint=lambda: painter.paint(view, casters, movers))


def mixed_scene(sunlight: Sunlight = SUN) -> SimpleNamespace:
    return scene(MIXED, street(), street((Texture.FOLIAGE,)).moved(-8.0, 9.0), sunlight)


def slow_image(made, sunlight: Sunlight, lit):
    """Shade all pixels at once, one array for each step of the arithmetic."""
    view, sun = made.view, sunlight.direction
    edges = made.soup.triangles_m[:, 1:] - made.soup.triangles_m[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    on_ground = view.triangle == NO_TRIANGLE
    normal = np.where(on_ground[:, None], np.array([0, 0, 1], np.float32), normals[view.triangle])
    facing = np.maximum(normal[:, 0] * sun[0] + normal[:, 1] * sun[1] + normal[:, 2] * sun[2], 0)
    texture = np.where(on_ground, Texture.PLAIN, made.soup.texture[view.triangle])
    of_ground = np.where(view.surface == Surface.TERRAIN, 0.30, 0.13)
    of_texture = np.array([0.06, 0.12, 0.16, 0.42, 0.08, 0.08])[texture]
    colour = np.where(on_ground[:, None], SURFACE_COLOURS[view.surface], made.soup.colour[view.triangle])

    x_m, y_m, z_m = view.points_m.T
    is_wall = ~on_ground & (np.abs(normal[:, 2]) < 0.7)
    along_m = np.where(is_wall, y_m * normal[:, 0] - x_m * normal[:, 1], x_m)
    across_m = np.where(is_wall, z_m, y_m)
    tile = shading._noise_tile()

    def noise(per_m):
        place = [(value * np.float32(per_m)).astype(np.int64) % len(tile) for value in (across_m, along_m)]
        return tile[place[0], place[1]]

    brightness = 1.0 + (noise(24) + 0.7 * noise(3)) * np.where(on_ground, of_ground, of_texture)
    column, row = np.mod(along_m / 2.3, 1.0), np.mod(z_m / 3.1, 1.0)
    is_window = (abs(column - 0.5) < 0.24) & (abs(row - 0.52) < 0.26)
    brightness[is_wall & (texture == Texture.FACADE) & is_window] *= 0.42
    brightness[(texture == Texture.PLANKS) & ((along_m * np.float32(6)).astype(np.int64) % 2 == 0)] *= 0.75
    brightness *= facing * lit * 0.62 * (1 - sunlight.overcast) + 0.52 + 0.45 * sunlight.overcast
    haze, clarity = np.array([188, 196, 204]), np.exp(-np.minimum(view.depth_m, 1000) / 260.0)[:, None]
    rgb = np.clip((colour * brightness[:, None] - haze) * clarity + haze, 0, 255)
    return cv2.cvtColor(np.rint(rgb).astype(np.uint8).reshape(HEIGHT, WIDTH, 3), cv2.COLOR_RGB2BGR)


@pytest.mark.parametrize("overcast", [0.15, 0.85])
def test_the_picture_is_that_of_the_same_arithmetic_on_whole_arrays(monkeypatch, overcast):
    lit = np.random.default_rng(0).random(WIDTH * HEIGHT).astype(np.float32)
    monkeypatch.setattr(Painter, "_lit", lambda *_: lit)
    sunlight = Sunlight(SUN.azimuth_rad, SUN.elevation_rad, overcast)
    made = mixed_scene(sunlight)
    image = made.paint()
    is_sky = np.isinf(made.view.depth_m).reshape(HEIGHT, WIDTH)
    difference = np.abs(image.astype(int) - slow_image(made, sunlight, lit).astype(int)).max(axis=2)[~is_sky]
    assert {int(value) for value in np.unique(made.soup.texture[made.view.triangle])} == set(Texture)
    # Double precision rounds a few pixels to the other side, of a level or of the edge of a pane or a grain.
    assert np.mean(difference > 0) < 0.01


def test_sky_is_paler_towards_the_horizon_and_untouched_by_what_stands_before_it():
    made = mixed_scene()
    image, is_sky = made.paint(), np.isinf(made.view.depth_m).reshape(HEIGHT, WIDTH)
    red = [image[row, is_sky[row], 2] for row in range(HEIGHT) if is_sky[row].any()]
    assert all(np.ptp(row) <= 1 for row in red)  # level but for the camera's small yaw
    assert red[0].mean() < red[-1].mean()


def test_what_stands_or_moves_between_sun_and_ground_throws_a_shadow():
    nothing = soup_of_boxes(np.zeros(0, BOX))
    high = box((14.0, 0.0, 0.0), (8.0, 9.0), (5.0, 5.0), (LABEL_ID["building"], int(Texture.PLAIN), (90, 90, 90)))
    roof = soup_of_boxes(np.array([high], BOX))
    sun = Sunlight(0.0, 1.5, 0.15)  # overhead
    bright, of_still, of_mover = (
        scene(TERRAIN, still, movers, sun).paint().astype(int)
        for still, movers in ((nothing, nothing), (roof, nothing), (nothing, roof))
    )
    darker = (bright - of_still).sum(axis=2) > 60
    assert darker[HEIGHT // 2 + 4 :].any()
    assert not darker[-1].any()  # ground nearer than the roof
    np.testing.assert_array_equal(of_still, of_mover)
