"""Rays cast with Embree at the town's triangles and an analytic ground plane, and those of a pinhole camera."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import MissingExtraError
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.types import CameraCalibration, Pose
from semgrid_eval.sources.town.ground import SURFACE_LABELS, Ground
from semgrid_eval.sources.town.solids import Soup

Float32s = NDArray[np.float32]
Float = TypeVar("Float", np.float32, np.float64)
FULL_WIDTH_PX, FULL_HEIGHT_PX = 2048, 1024
MAX_DEPTH_M = 400.0
NO_TRIANGLE = -1
_SKY = LABEL_ID["sky"]


def cityscapes_camera(width_px: int, height_px: int) -> CameraCalibration:
    """Return a camera like the one of Cityscapes, scaled to an image size with half-pixel centres."""
    scale_u, scale_v = width_px / FULL_WIDTH_PX, height_px / FULL_HEIGHT_PX
    return CameraCalibration(
        fx_px=2262.0 * scale_u,
        fy_px=2265.0 * scale_v,
        u0_px=(1096.0 + 0.5) * scale_u - 0.5,
        v0_px=(513.0 + 0.5) * scale_v - 0.5,
        baseline_m=0.209,
        x_m=1.7,
        y_m=0.1,
        z_m=1.22,
        roll_rad=0.0,
        pitch_rad=0.038,
        yaw_rad=-0.002,
    )


@dataclass(frozen=True)
class View:
    """What an eye sees, one row a ray; of a camera a pixel, row by row (N = H * W)."""

    depth_m: Float32s  # (N,) in lengths of the ray (of a camera along its optical axis), infinite for the sky
    points_m: Float32s  # (N, 3) what is seen, in the frame of the stage; of the sky, something far away
    label: NDArray[np.uint8]  # (N,) Cityscapes label id
    instance: NDArray[np.uint16]  # (N,) actor id, 0 where there is none
    surface: NDArray[np.uint8]  # (N,) of the ground, where there is ground
    triangle: NDArray[np.int32]  # (N,) index of the triangle that is seen, `NO_TRIANGLE` where it is ground or sky


class Eye(ABC):
    """A place on a vehicle from which N rays go out."""

    @property
    @abstractmethod
    def rays_ego(self) -> Float32s:
        """Rays (N, 3) in the vehicle frame."""

    @property
    @abstractmethod
    def origin_ego_m(self) -> NDArray[np.float64]:
        """The place (3,) in the vehicle frame."""

    @cached_property
    def ground_depth_m(self) -> Float32s:
        """How far each ray (N,) gets to the ground plane, in its own lengths; infinite where it does not meet it."""
        fall = -self.rays_ego[:, 2]
        with np.errstate(divide="ignore"):
            return np.where(fall > 0.0, self.origin_ego_m[2] / fall, np.inf).astype(np.float32)


@dataclass(frozen=True)
class Camera(Eye):
    """A pinhole camera on a vehicle; pixels are numbered row by row (N = H * W)."""

    calibration: CameraCalibration
    width_px: int
    height_px: int

    @cached_property
    def rays_ego(self) -> Float32s:
        """Rays (N, 3) in the vehicle frame; their part along the optical axis is 1, so a ray's length is depth."""
        c = self.calibration
        right = (np.arange(self.width_px) - c.u0_px) / c.fx_px
        down = (np.arange(self.height_px) - c.v0_px) / c.fy_px
        rays = np.stack(np.broadcast_arrays(right[None], down[:, None], 1.0), axis=-1).reshape(-1, 3)
        return (rays @ c.ego_from_optical.rotation.T).astype(np.float32)

    @cached_property
    def origin_ego_m(self) -> NDArray[np.float64]:
        """The optical centre (3,) in the vehicle frame."""
        return np.array([self.calibration.x_m, self.calibration.y_m, self.calibration.z_m])

    def disparity_px(self, depth_m: Float32s) -> Float32s:
        """Return the disparity of depths; that of the sky is 0."""
        return (self.calibration.depth_disparity_m_px / depth_m).astype(np.float32)


class RayCaster:
    """Triangles that rays can be cast at."""

    def __init__(self, triangles_m: Float32s) -> None:
        """Build Embree's tree over triangles (F, 3, 3)."""
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError:
            raise MissingExtraError("synthetic", "embreex") from None
        self.count = len(triangles_m)
        self._scene = EmbreeScene()
        if self.count:
            TriangleMesh(self._scene, np.ascontiguousarray(triangles_m))

    def cast(self, origins_m: Float32s, rays: Float32s, limit: Float32s) -> tuple[Float32s, NDArray[np.int32]]:
        """Return how far each ray from origins (N, 3) gets, in its own lengths, and the triangle that stops it.

        Nothing is seen beyond `limit` (N,).
        """
        if not self.count:
            return limit, np.full(len(rays), NO_TRIANGLE, np.int32)
        found = self._scene.run(origins_m, rays, dists=limit, query="INTERSECT", output=True)
        return found["tfar"], found["primID"]


def cast_at_all(
    casters: Sequence[RayCaster], origins_m: Float32s, rays: Float32s, limit: Float32s
) -> tuple[Float32s, NDArray[np.int32]]:
    """Cast rays at several sets of triangles, numbered one set after the other; see `RayCaster.cast`."""
    reached, triangle, first = limit, np.full(len(rays), NO_TRIANGLE, np.int32), 0
    for caster in casters:
        reached, hit = caster.cast(origins_m, rays, reached)
        triangle = np.where(hit == NO_TRIANGLE, triangle, hit + first)
        first += caster.count
    return reached, triangle


def look(
    eye: Eye,
    pose: Pose,
    casters: Sequence[RayCaster],
    soup: Soup,
    ground: Ground,
    stage_m: tuple[float, float] = (0.0, 0.0),
) -> View:
    """Cast the rays of an eye.

    The soup's triangles, which the casters hold, are in the frame of the stage. Its origin is `stage_m` (x, y) in the
    map frame, near the vehicle, where single precision is exact enough.
    """
    rays = _turned(eye.rays_ego, pose.yaw_rad)
    offset_m = (pose.x_m - stage_m[0], pose.y_m - stage_m[1], 0.0)
    origin_m = (_turned(eye.origin_ego_m[None], pose.yaw_rad)[0] + offset_m).astype(np.float32)
    origins_m = np.ascontiguousarray(np.broadcast_to(origin_m, rays.shape))
    reached_m, triangle = cast_at_all(casters, origins_m, rays, np.minimum(eye.ground_depth_m, MAX_DEPTH_M))
    is_open = triangle == NO_TRIANGLE
    points_m = rays * reached_m[:, None]
    points_m += origin_m
    surface = ground.at(points_m[:, 0] + np.float32(stage_m[0]), points_m[:, 1] + np.float32(stage_m[1]))
    behind = np.where(np.isinf(eye.ground_depth_m), np.uint8(_SKY), SURFACE_LABELS[surface])
    nobody = np.zeros(len(rays), np.uint16)
    return View(
        depth_m=np.where(is_open, eye.ground_depth_m, reached_m),
        points_m=points_m,
        label=np.where(is_open, behind, soup.label[triangle]) if len(soup) else behind,
        instance=np.where(is_open, nobody, soup.instance[triangle]) if len(soup) else nobody,
        surface=surface,
        triangle=triangle,
    )


def _turned(vectors: NDArray[Float], yaw_rad: float) -> NDArray[Float]:
    """Turn vectors (N, 3) about the vertical; not by a matrix product, whose threads cost more than they save here."""
    cos, sin = vectors.dtype.type(math.cos(yaw_rad)), vectors.dtype.type(math.sin(yaw_rad))
    x, y, z = vectors.T
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
