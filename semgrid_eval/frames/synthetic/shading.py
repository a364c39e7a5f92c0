"""The colour image: sun, shadow, sky and textures that are fixed to the world, so that stereo matching finds them."""

import math
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.frames.synthetic.ground import SURFACE_COLOURS, Surface
from semgrid_eval.frames.synthetic.sensors import NO_TRIANGLE, Camera, RayCaster, View
from semgrid_eval.frames.synthetic.solids import Soup, Texture
from semgrid_eval.frames.types import Pose

_TILE_PX = 512
_AMBIENT, _SUN = 0.52, 0.62
_SHADOW_STEP = 2  # shadows are cast for every second pixel of every second row
_WINDOW_M, _FLOOR_M = 2.3, 3.1
_HAZE_M = 260.0


@dataclass(frozen=True)
class Sunlight:
    """Where the sun stands in the map frame, and how the sky looks."""

    azimuth_rad: float
    elevation_rad: float
    overcast: float  # 0 clear to 1 no shadow

    def direction_ego(self, yaw_rad: float) -> NDArray[np.float32]:
        """Return the unit vector (3,) to the sun in the vehicle frame."""
        azimuth = self.azimuth_rad - yaw_rad
        level = math.cos(self.elevation_rad)
        return np.array(
            [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(self.elevation_rad)], np.float32
        )


def draw_sunlight(rng: np.random.Generator) -> Sunlight:
    """Draw a time of day and a weather."""
    return Sunlight(
        float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(0.45, 1.1)), float(rng.choice([0.15, 0.4, 0.85]))
    )


def shade(
    camera: Camera, view: View, caster: RayCaster, soup: Soup, pose: Pose, sunlight: Sunlight
) -> NDArray[np.uint8]:
    """Return the colour image (H, W, 3) in OpenCV's order (blue, green, red).

    Args:
        camera: that saw the view.
        view: what is seen.
        caster: holds the soup's triangles, which throw shadows.
        soup: the triangles in the vehicle frame, with their colours and textures.
        pose: of the vehicle.
        sunlight: of the recording.
    """
    depth_m = np.minimum(view.depth_m, 1e3).reshape(-1)
    points_ego = camera.points_ego(depth_m)
    triangle = view.triangle.reshape(-1)
    on_triangle = triangle != NO_TRIANGLE
    sun = sunlight.direction_ego(pose.yaw_rad)
    normals = _normals(soup.triangles_m)
    facing = np.where(on_triangle, np.maximum(normals @ sun, 0.0)[triangle], sun[2])
    lit = _lit(view, points_ego, caster, normals, sun) * (1.0 - sunlight.overcast)
    ground_colour = SURFACE_COLOURS[view.surface.reshape(-1)]
    colour = np.where(on_triangle[:, None], soup.colour[triangle], ground_colour).astype(np.float32)
    light = _AMBIENT + 0.25 * sunlight.overcast + _SUN * facing * lit
    texture = _texture(points_ego, view, normals, soup, pose)
    colour *= (light * texture).astype(np.float32)[:, None]
    haze = (1.0 - np.exp(-depth_m / _HAZE_M))[:, None].astype(np.float32)
    colour += haze * (np.array([188, 196, 204], np.float32) - colour)
    sky = _sky(camera, sunlight)
    image = np.where(np.isinf(view.depth_m).reshape(-1, 1), sky, colour)
    return np.clip(image, 0, 255).astype(np.uint8).reshape(*view.label.shape, 3)[:, :, ::-1].copy()


def _normals(triangles_m: NDArray[np.float32]) -> NDArray[np.float32]:
    edges = triangles_m[:, 1:] - triangles_m[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.maximum(lengths, 1e-12)).astype(np.float32)


def _lit(
    view: View,
    points_ego: NDArray[np.float32],
    caster: RayCaster,
    normals: NDArray[np.float32],
    sun: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Return 1 where the sun reaches a pixel's point and 0 in shadow, (H * W,), softened by the coarser sampling."""
    height, width = view.label.shape
    coarse = np.arange(height * width).reshape(height, width)[::_SHADOW_STEP, ::_SHADOW_STEP]
    index = coarse.reshape(-1)[np.isfinite(view.depth_m.reshape(-1)[coarse.reshape(-1)])]
    triangle = view.triangle.reshape(-1)[index]
    up = np.array([0.0, 0.0, 1.0], np.float32)
    lift_m = np.float32(0.03) * np.where((triangle == NO_TRIANGLE)[:, None], up, normals[triangle])
    rays = np.tile(sun, (len(index), 1))
    far_m = np.full(len(index), 120.0, np.float32)
    _, hit = caster.cast(points_ego[index] + lift_m, rays, far_m)
    lit = np.ones(height * width, np.float32)
    lit[index] = hit == NO_TRIANGLE
    return cv2.resize(lit[coarse], (width, height), interpolation=cv2.INTER_LINEAR).reshape(-1)


def _texture(
    points_ego: NDArray[np.float32], view: View, normals: NDArray[np.float32], soup: Soup, pose: Pose
) -> NDArray[np.float32]:
    """Return the brightness (H * W,) of each pixel's surface: noise in the world's coordinates, windows, planks."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    x_m = np.float32(pose.x_m % 1000) + np.float32(cos) * points_ego[:, 0] - np.float32(sin) * points_ego[:, 1]
    y_m = np.float32(pose.y_m % 1000) + np.float32(sin) * points_ego[:, 0] + np.float32(cos) * points_ego[:, 1]
    z_m = points_ego[:, 2]
    triangle = view.triangle.reshape(-1)
    on_triangle = triangle != NO_TRIANGLE
    normal_x = cos * normals[:, 0] - sin * normals[:, 1]
    normal_y = sin * normals[:, 0] + cos * normals[:, 1]
    is_wall = on_triangle & (np.abs(normals[:, 2]) < 0.7)[triangle]
    along_m = np.where(is_wall, y_m * normal_x[triangle] - x_m * normal_y[triangle], x_m)
    across_m = np.where(is_wall, z_m, y_m)
    kind = np.where(on_triangle, soup.texture[triangle], np.uint8(Texture.ROOF))
    contrast = _CONTRAST[kind]
    contrast = np.where(on_triangle, contrast, _GROUND_CONTRAST[view.surface.reshape(-1)])
    shade = 1.0 + contrast * (_noise(along_m, across_m, 24.0) + 0.7 * _noise(along_m, across_m, 3.0))
    window = (kind == Texture.FACADE) & is_wall & _is_window(along_m, z_m)
    shade *= np.where(window, np.float32(0.42), np.float32(1.0))
    planks = (kind == Texture.PLANKS) & ((along_m * 6.0).astype(np.int32) % 2 == 0)
    return np.where(planks, 0.75 * shade, shade).astype(np.float32)


_CONTRAST = np.array([0.06, 0.12, 0.16, 0.42, 0.05, 0.12], np.float32)
_GROUND_CONTRAST = np.array(
    [0.30 if surface is Surface.TERRAIN else 0.13 for surface in Surface], np.float32
)


def _is_window(along_m: NDArray[np.float32], z_m: NDArray[np.float32]) -> NDArray[np.bool_]:
    column = np.mod(along_m * np.float32(1.0 / _WINDOW_M), 1.0)
    row = np.mod(z_m * np.float32(1.0 / _FLOOR_M), 1.0)
    return (np.abs(column - 0.5) < 0.24) & (np.abs(row - 0.52) < 0.26)


def _noise(a_m: NDArray[np.float32], b_m: NDArray[np.float32], per_m: float) -> NDArray[np.float32]:
    """Look noise up in the tile, `per_m` of its pixels a metre."""
    scale = np.float32(per_m)
    column = (a_m * scale).astype(np.int32) & (_TILE_PX - 1)
    row = (b_m * scale).astype(np.int32) & (_TILE_PX - 1)
    return np.take(_noise_tile().reshape(-1), row * _TILE_PX + column)


@cache
def _noise_tile() -> NDArray[np.float32]:
    """Return a tile (P, P) of noise with fine and coarse grain, zero on average, mostly within -1..1."""
    rng = np.random.default_rng(7)
    tile = np.zeros((_TILE_PX, _TILE_PX), np.float32)
    for sigma, weight in ((0.0, 0.45), (1.5, 0.5), (6.0, 0.5)):
        layer = rng.standard_normal((_TILE_PX, _TILE_PX)).astype(np.float32)
        if sigma:
            layer = cv2.GaussianBlur(layer, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
        tile += weight * layer / layer.std()
    return tile


def _sky(camera: Camera, sunlight: Sunlight) -> NDArray[np.float32]:
    """Return the sky's colour (H * W, 3) for every pixel: paler towards the horizon, grey when overcast."""
    height = np.clip(camera.rays_ego[:, 2] * 2.2, 0.0, 1.0)[:, None]
    top = np.array([112, 152, 206], np.float32) * (1 - sunlight.overcast) + 178 * np.float32(sunlight.overcast)
    return np.array([216, 222, 228], np.float32) * (1.0 - height) + top * height
