"""The colour image: sun, shadow, sky and textures that are fixed to the world, so that stereo matching finds them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.frames.synthetic.ground import SURFACE_COLOURS, Surface
from semgrid_eval.frames.synthetic.sensors import NO_TRIANGLE, Camera, RayCaster, View, cast_at_all
from semgrid_eval.frames.synthetic.solids import Soup, Texture

_TILE_PX = 512
_AMBIENT, _SUN = 0.52, 0.62
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
class _Materials:
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
        return cls(
            normal,
            facing,
            np.abs(normal[:, 2]) < 0.7,
            soup.colour.astype(np.float32),
            soup.texture,
            _CONTRAST[soup.texture],
        )

    @classmethod
    def of_ground(cls, sun: NDArray[np.float32]) -> "_Materials":
        count = len(SURFACE_COLOURS)
        normal = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (count, 1))
        plain = np.full(count, Texture.PLAIN, np.uint8)
        colour = SURFACE_COLOURS.astype(np.float32)
        return cls(normal, normal @ sun, np.zeros(count, bool), colour, plain, _GROUND_CONTRAST)

    @staticmethod
    def joined(parts: "Sequence[_Materials]") -> "_Materials":
        return _Materials(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(_Materials)))


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

        Args:
            view: what is seen; its triangles are those that stand still, then those that move.
            casters: hold the triangles that throw shadows.
            movers: triangles that move, in the frame of the stage.
        """
        sun = self._sunlight
        materials = _Materials.joined([self._still, _Materials.of_soup(movers, sun.direction), self._ground])
        first_ground = len(materials.facing) - len(self._ground.facing)
        material = np.where(view.triangle == NO_TRIANGLE, view.surface + np.int32(first_ground), view.triangle)
        normal = np.take(materials.normal, material, axis=0)
        light = materials.facing[material] * self._lit(view, casters, normal) * np.float32(_SUN * (1.0 - sun.overcast))
        light += np.float32(_AMBIENT + 0.45 * sun.overcast)
        light *= _texture(view, materials, material, normal)
        painted = np.take(materials.colour, material, axis=0)
        painted *= light[:, None]
        painted -= _HAZE_COLOUR
        painted *= np.exp(np.minimum(view.depth_m, 1e3) * np.float32(-1.0 / _HAZE_M))[:, None]
        painted += _HAZE_COLOUR
        is_sky = np.flatnonzero(np.isinf(view.depth_m))
        painted[is_sky] = self._sky[is_sky]
        rgb = cv2.convertScaleAbs(np.maximum(painted, 0.0, out=painted))
        return np.asarray(cv2.cvtColor(rgb.reshape(*self._shape, 3), cv2.COLOR_RGB2BGR))

    def _lit(self, view: View, casters: Sequence[RayCaster], normal: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return 1 where the sun reaches a pixel's point and 0 in shadow (N,), softened by the coarser sampling."""
        height, width = self._shape
        pixels = np.arange(height * width).reshape(height, width)[::_SHADOW_STEP, ::_SHADOW_STEP]
        seen = pixels[np.isfinite(view.depth_m[pixels])]
        rays = np.tile(self._sunlight.direction, (len(seen), 1))
        reach_m = np.full(len(seen), _SHADOW_REACH_M, np.float32)
        _, hit = cast_at_all(casters, view.points_m[seen] + np.float32(0.03) * normal[seen], rays, reach_m)
        lit = np.ones(height * width, np.float32)
        lit[seen] = hit == NO_TRIANGLE
        return np.asarray(cv2.resize(lit[pixels], (width, height), interpolation=cv2.INTER_LINEAR).reshape(-1))


def _texture(
    view: View, materials: _Materials, material: NDArray[np.int32], normal: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the brightness (N,) of each pixel's surface: noise fixed to the world, windows, planks."""
    x_m, y_m, z_m = np.ascontiguousarray(view.points_m.T)
    is_wall = materials.is_wall[material]
    along_m = np.where(is_wall, y_m * normal[:, 0] - x_m * normal[:, 1], x_m)
    across_m = np.where(is_wall, z_m, y_m)
    brightness = _noise(along_m, across_m, 24.0) + np.float32(0.7) * _noise(along_m, across_m, 3.0)
    brightness *= materials.contrast[material]
    brightness += np.float32(1.0)
    texture = materials.texture[material]
    facade = np.flatnonzero(is_wall & (texture == Texture.FACADE))
    brightness[facade[_is_window(along_m[facade], z_m[facade])]] *= np.float32(0.42)
    planks = np.flatnonzero(texture == Texture.PLANKS)
    brightness[planks[(along_m[planks] * 6.0).astype(np.int32) % 2 == 0]] *= np.float32(0.75)
    return brightness


def _is_window(along_m: NDArray[np.float32], z_m: NDArray[np.float32]) -> NDArray[np.bool_]:
    column = np.mod(along_m * np.float32(1.0 / _WINDOW_M), 1.0)
    row = np.mod(z_m * np.float32(1.0 / _FLOOR_M), 1.0)
    return np.asarray((np.abs(column - 0.5) < 0.24) & (np.abs(row - 0.52) < 0.26))


def _noise(a_m: NDArray[np.float32], b_m: NDArray[np.float32], per_m: float) -> NDArray[np.float32]:
    """Look noise up in the tile, `per_m` of its pixels a metre."""
    scale = np.float32(per_m)
    column = (a_m * scale).astype(np.int32) & (_TILE_PX - 1)
    row = (b_m * scale).astype(np.int32) & (_TILE_PX - 1)
    return np.take(_noise_tile(), row * _TILE_PX + column)


@cache
def _noise_tile() -> NDArray[np.float32]:
    """Return a square tile (P * P,) of noise with fine and coarse grain, zero on average, mostly within -1..1."""
    rng = np.random.default_rng(7)
    tile = np.zeros((_TILE_PX, _TILE_PX), np.float32)
    for sigma, weight in ((0.0, 0.45), (1.5, 0.5), (6.0, 0.5)):
        layer = rng.standard_normal((_TILE_PX, _TILE_PX), np.float32)
        if sigma:
            blurred = cv2.GaussianBlur(layer, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
            layer = np.asarray(blurred, np.float32)
        tile += np.float32(weight) * layer / layer.std()
    return tile.reshape(-1)


def _sky(camera: Camera, sunlight: Sunlight) -> NDArray[np.float32]:
    """Return the sky's colour (N, 3) behind every pixel: paler towards the horizon, grey when overcast."""
    height = np.clip(camera.rays_ego[:, 2] * 2.2, 0.0, 1.0)[:, None]
    clear, grey = np.array([112, 152, 206], np.float32), np.float32(178)
    top = clear * np.float32(1.0 - sunlight.overcast) + grey * np.float32(sunlight.overcast)
    return np.asarray(np.array([216, 222, 228], np.float32) * (1.0 - height) + top * height, np.float32)
