"""The colour image: sun, shadow, sky and textures that are fixed to the world, so that stereo matching finds them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.sources.town.columns import Columns
from semgrid_eval.sources.town.ground import SURFACE_COLOURS, Surface
from semgrid_eval.sources.town.sensors import NO_TRIANGLE, Camera, RayCaster, View, cast_at_all
from semgrid_eval.sources.town.solids import Soup, Texture

_TILE_PX = 512
_AMBIENT, _SUN = 0.52, 0.62
_FACADE, _PLANKS = int(Texture.FACADE), int(Texture.PLANKS)
_SHADOW_STEP = 2  # shadows are cast for every second pixel of every second row
_SHADOW_REACH_M = 100.0
_WINDOW_M, _FLOOR_M = 2.3, 3.1
_HAZE_M = 260.0
_HAZE_COLOUR = np.array([188, 196, 204], np.float32)
_CONTRASTS = {Texture.PLAIN: 0.06, Texture.FACADE: 0.12, Texture.ROOF: 0.16, Texture.FOLIAGE: 0.42}
_CONTRAST = np.array([_CONTRASTS.get(texture, 0.08) for texture in Texture], np.float32)
_GROUND_CONTRAST = np.array([0.30 if surface is Surface.TERRAIN else 0.13 for surface in Surface], np.float32)


@dataclass(frozen=True)
class Sunlight:
    """Where the sun stands in the map frame, and how clear the sky is."""

    azimuth_rad: float
    elevation_rad: float
    overcast: float  # 0 clear to 1 no shadow

    @property
    def direction(self) -> NDArray[np.float32]:
        """Unit vector (3,) to the sun."""
        level = math.cos(self.elevation_rad)
        east, north = level * math.cos(self.azimuth_rad), level * math.sin(self.azimuth_rad)
        return np.array([east, north, math.sin(self.elevation_rad)], np.float32)


def draw_sunlight(rng: np.random.Generator) -> Sunlight:
    """Draw a time of day and a weather."""
    azimuth_rad, elevation_rad = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(0.45, 1.1))
    return Sunlight(azimuth_rad, elevation_rad, float(rng.choice([0.15, 0.4, 0.85])))


@dataclass(frozen=True)
class _Materials(Columns):
    """How each triangle, or in a table of their own each surface of the ground, takes the light (M,)."""

    normal: NDArray[np.float32]  # (M, 3)
    facing: NDArray[np.float32]  # the sun: cosine, 0 where it turns away
    is_wall: NDArray[np.bool_]
    colour: NDArray[np.float32]  # (M, 3) sRGB, 0 to 255
    texture: NDArray[np.uint8]
    contrast: NDArray[np.float32]

    @classmethod
    def of_soup(cls, soup: Soup, sun: NDArray[np.float32]) -> "_Materials":
        edges = soup.triangles_m[:, 1:] - soup.triangles_m[:, :1]
        normal = np.cross(edges[:, 0], edges[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        facing = np.maximum(normal[:, 0] * sun[0] + normal[:, 1] * sun[1] + normal[:, 2] * sun[2], 0.0)
        is_wall = np.abs(normal[:, 2]) < 0.7
        return cls(normal, facing, is_wall, soup.colour.astype(np.float32), soup.texture, _CONTRAST[soup.texture])

    @classmethod
    def of_ground(cls, sun: NDArray[np.float32]) -> "_Materials":
        count = len(SURFACE_COLOURS)
        normal = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (count, 1))
        plain = np.full(count, Texture.PLAIN, np.uint8)
        colour = SURFACE_COLOURS.astype(np.float32)
        return cls(normal, normal @ sun, np.zeros(count, bool), colour, plain, _GROUND_CONTRAST)


class Painter:
    """Paints the pictures of one recording: one camera, one light, one set of things that stand still."""

    def __init__(self, camera: Camera, sunlight: Sunlight, still: Soup) -> None:
        self._shape = (camera.height_px, camera.width_px)
        self._sunlight = sunlight
        self._still = _Materials.of_soup(still, sunlight.direction)
        self._ground = _Materials.of_ground(sunlight.direction)
        self._sky = _sky(camera, sunlight)

    def paint(self, view: View, casters: Sequence[RayCaster], movers: Soup) -> NDArray[np.uint8]:
        """Return the colour image (H, W, 3) in OpenCV's order (blue, green, red).

        Triangles of the view are those that stand still, then the movers'; those of the casters throw shadows.
        """
        sun = self._sunlight
        materials = _Materials.joined([self._still, _Materials.of_soup(movers, sun.direction), self._ground])
        first_ground = len(materials.facing) - len(self._ground.facing)
        material = np.where(view.triangle == NO_TRIANGLE, view.surface + np.int32(first_ground), view.triangle)
        lit = self._lit(view, casters, materials.normal, material)
        light = (np.float32(_SUN * (1.0 - sun.overcast)), np.float32(_AMBIENT + 0.45 * sun.overcast))
        # Not in the loop below, whose exponential would round other than NumPy's.
        clarity = np.exp(np.minimum(view.depth_m, 1e3) * np.float32(-1.0 / _HAZE_M))
        tables = tuple(getattr(materials, field.name) for field in fields(_Materials))
        image = self._sky.copy()
        _paint(image, view.points_m, material, tables, _noise_tile(), light, lit, clarity, np.isinf(view.depth_m))
        return image.reshape(*self._shape, 3)

    def _lit(
        self, view: View, casters: Sequence[RayCaster], normal: NDArray[np.float32], material: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """Return 1 where the sun reaches a pixel's point and 0 in shadow (N,), softened by the coarser sampling."""
        height, width = self._shape
        pixels = np.arange(height * width).reshape(height, width)[::_SHADOW_STEP, ::_SHADOW_STEP]
        seen = pixels[np.isfinite(view.depth_m[pixels])]
        rays = np.tile(self._sunlight.direction, (len(seen), 1))
        reach_m = np.full(len(seen), _SHADOW_REACH_M, np.float32)
        _, hit = cast_at_all(casters, view.points_m[seen] + np.float32(0.03) * normal[material[seen]], rays, reach_m)
        lit = np.ones(height * width, np.float32)
        lit[seen] = hit == NO_TRIANGLE
        return np.asarray(cv2.resize(lit[pixels], (width, height), interpolation=cv2.INTER_LINEAR).reshape(-1))


@numba.njit(cache=True, nogil=True)
def _paint(image, points_m, material, tables, tile, light, lit, clarity, is_sky):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Write the colours (N, 3) of all pixels but the sky's, blue first; single precision throughout."""
    normal, facing, is_wall, colour, texture, contrast = tables
    sunshine, daylight = light
    for pixel in range(len(material)):
        if is_sky[pixel]:
            continue
        m = material[pixel]
        x_m, y_m, z_m = points_m[pixel, 0], points_m[pixel, 1], points_m[pixel, 2]
        along_m, across_m = x_m, y_m
        if is_wall[m]:
            along_m, across_m = y_m * normal[m, 0] - x_m * normal[m, 1], z_m
        noise = _noise(tile, along_m, across_m, np.float32(24.0))
        noise += np.float32(0.7) * _noise(tile, along_m, across_m, np.float32(3.0))
        brightness = noise * contrast[m] + np.float32(1.0)
        if texture[m] == _FACADE and is_wall[m] and _is_window(along_m, z_m):
            brightness *= np.float32(0.42)
        elif texture[m] == _PLANKS and np.int32(along_m * np.float32(6.0)) % 2 == 0:
            brightness *= np.float32(0.75)
        brightness *= facing[m] * lit[pixel] * sunshine + daylight
        for channel in range(3):
            haze = _HAZE_COLOUR[channel]
            value = (colour[m, channel] * brightness - haze) * clarity[pixel] + haze
            image[pixel, 2 - channel] = np.uint8(np.rint(min(max(value, np.float32(0.0)), np.float32(255.0))))


@numba.njit(cache=True, nogil=True)
def _is_window(along_m, z_m):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    column, row = along_m * np.float32(1.0 / _WINDOW_M), z_m * np.float32(1.0 / _FLOOR_M)
    column, row = column - np.floor(column), row - np.floor(row)
    return abs(column - np.float32(0.5)) < np.float32(0.24) and abs(row - np.float32(0.52)) < np.float32(0.26)


@numba.njit(cache=True, nogil=True)
def _noise(tile, a_m, b_m, per_m):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Look noise up in the tile, `per_m` of its pixels a metre."""
    return tile[np.int32(b_m * per_m) & (_TILE_PX - 1), np.int32(a_m * per_m) & (_TILE_PX - 1)]


@cache
def _noise_tile() -> NDArray[np.float32]:
    """Return a square tile (P, P) of noise with fine and coarse grain, zero on average, mostly within -1..1."""
    rng = np.random.default_rng(7)
    tile = np.zeros((_TILE_PX, _TILE_PX), np.float32)
    for sigma, weight in ((0.0, 0.45), (1.5, 0.5), (6.0, 0.5)):
        layer = rng.standard_normal((_TILE_PX, _TILE_PX), np.float32)
        if sigma:
            blurred = cv2.GaussianBlur(layer, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
            layer = np.asarray(blurred, np.float32)
        tile += np.float32(weight) * layer / layer.std()
    return tile


def _sky(camera: Camera, sunlight: Sunlight) -> NDArray[np.uint8]:
    """Return the sky's colour (N, 3) behind every pixel, blue first: paler towards the horizon, grey when overcast."""
    height = np.clip(camera.rays_ego[:, 2] * 2.2, 0.0, 1.0)[:, None]
    clear, grey = np.array([112, 152, 206], np.float32), np.float32(178)
    top = clear * np.float32(1.0 - sunlight.overcast) + grey * np.float32(sunlight.overcast)
    colour = np.array([216, 222, 228], np.float32) * (1.0 - height) + top * height
    return np.asarray(np.rint(colour[:, ::-1].astype(np.float32)), np.uint8)
