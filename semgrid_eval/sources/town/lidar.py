"""A spinning LiDAR: its rays, and the errors of what it measures and of what a network says of its points."""

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.sources.town.ground import SURFACE_COLOURS
from semgrid_eval.sources.town.noise import LabelErrors, LabelNoise
from semgrid_eval.sources.town.sensors import NO_TRIANGLE, Eye, View
from semgrid_eval.sources.town.solids import Soup, Texture

Float32s = NDArray[np.float32]
ELEVATIONS_RAD = np.radians(np.concatenate([2.0 - np.arange(32) / 3.0, -8.0 - 5.0 / 6.0 - np.arange(32) / 2.0]))
"""The rings of a Velodyne HDL-64E, from the topmost: 32 of a third of a degree, 32 of half a degree (its manual)."""
RANGE_M = (0.9, 120.0)
"""Nearer than the first nothing is measured; the second is how far it sees foliage and cars."""
STEP_M = 1.0 / 512.0
"""Coordinates are whole multiples of this: the device gives ranges in steps of 2 mm."""
_SURE, _LIKE_PAVEMENT = 0.8, 0.1  # the share of light that comes back of foliage and cars, and of pavement, and ...
_PAVEMENT_M = 50.0  # ... how far the device sees such pavement; in between, ranges are a power of the share
_POWER = math.log(RANGE_M[1] / _PAVEMENT_M) / math.log(_SURE / _LIKE_PAVEMENT)
_GREEN = 0.5  # of foliage and grass, which are bright in the infrared, whatever their colour
_DARKEST = 0.05
_IS_GREEN = np.isin(np.arange(256), [LABEL_ID["vegetation"], LABEL_ID["terrain"]])
_GLASS = int(Texture.GLASS)
_SKY = LABEL_ID["sky"]


@dataclass(frozen=True)
class Lidar(Eye):
    """Where a LiDAR is, and how many directions it measures in a turn, with each of its rings."""

    mount: Mount
    columns: int = 1024

    @cached_property
    def rays(self) -> Float32s:
        """Rays (N, 3) of length 1 in its own frame, ring by ring; each turns from behind over the left to behind."""
        azimuth_rad = math.tau * (0.5 - (np.arange(self.columns) + 0.5) / self.columns)
        level, up = np.cos(ELEVATIONS_RAD)[:, None], np.sin(ELEVATIONS_RAD)[:, None]
        axes = np.broadcast_arrays(level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), up)
        return np.stack(axes, axis=-1).reshape(-1, 3).astype(np.float32)

    @cached_property
    def rays_ego(self) -> Float32s:
        """The same in the vehicle frame."""
        return (self.rays @ self.mount.ego_from_sensor.rotation.T).astype(np.float32)

    @cached_property
    def origin_ego_m(self) -> NDArray[np.float64]:
        """Its place (3,) in the vehicle frame."""
        return np.array(self.mount.place_m)


@dataclass(frozen=True)
class LidarNoise:
    """Errors of a LiDAR and of a network that labels its points."""

    range_m: float = 0.02  # standard deviation of each range
    lost: float = 0.02  # share of points that do not come back, wherever they are
    lost_in_glass: float = 0.7  # share of the points on windows that do not
    reach: float = 0.15  # standard deviation of the logarithm of the range at which a surface is lost
    intensity: float = 0.1  # standard deviation of the intensity, as a share
    # A network works on the picture of rings and directions, and errs there as the camera's does; borders are bent by a
    # point, so that what is seen just beside something is labelled like it.
    label: LabelNoise = field(
        default_factory=lambda: LabelNoise(warp_px=0.15, border_px=0.5, bad_borders=0.1, confused=0.0)
    )


class LidarErrors:
    """Turns what a LiDAR sees into sweeps, one after the other; without noise, all is exact."""

    def __init__(self, lidar: Lidar, noise: LidarNoise | None, rng: np.random.Generator) -> None:
        self._lidar, self._noise = lidar, noise
        measuring, labelling = rng.spawn(2)
        self._rng = measuring
        self._labels = LabelErrors(noise.label, labelling) if noise else None

    def sweep(self, stamp_ns: int, view: View, soup: Soup) -> LidarSweep:
        """Measure what is seen, of triangles those of the soup."""
        reflectance = reflectances(view, soup)
        label_id, range_m, reach_m = self.labelled(view.label), view.depth_m, np.full_like(view.depth_m, RANGE_M[1])
        lost = np.zeros(len(range_m), np.bool_)
        if self._noise is not None:
            lost = self._is_lost(view, soup, self._noise)
            reach_m = self._reach_m(reflectance, self._noise.reach)
            range_m = range_m + np.float32(self._noise.range_m) * self._drawn(len(range_m))
            reflectance = reflectance * (1.0 + np.float32(self._noise.intensity) * self._drawn(len(range_m)))
        seen = ~lost & (view.depth_m >= RANGE_M[0]) & (view.depth_m <= reach_m)
        points_m = self._lidar.rays[seen] * range_m[seen, None]
        return LidarSweep(
            stamp_ns=stamp_ns,
            mount=self._lidar.mount,
            points_m=np.rint(points_m * np.float32(1.0 / STEP_M)) * np.float32(STEP_M),
            intensity=np.rint(np.clip(reflectance[seen], 0.0, 1.0) * np.float32(255.0)) / np.float32(255.0),
            label_id=label_id[seen],
        )

    def labelled(self, exact: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the labels (N,) that a network gives to the next sweep; no point is taken for sky."""
        if self._labels is None:
            return exact
        found = self._labels.add(exact.reshape(-1, self._lidar.columns)).ravel()
        return np.where(found == _SKY, exact, found)

    def _is_lost(self, view: View, soup: Soup, noise: LidarNoise) -> NDArray[np.bool_]:
        hit = view.triangle != NO_TRIANGLE
        share = np.full(len(hit), noise.lost, np.float32)
        share[hit] = np.where(soup.texture[view.triangle[hit]] == _GLASS, noise.lost_in_glass, noise.lost)
        return np.asarray(self._rng.random(len(share), np.float32) < share)

    def _reach_m(self, reflectance: Float32s, spread: float) -> Float32s:
        """Return the range (N,) at which each surface is lost, drawn around what its brightness says."""
        nominal_m = RANGE_M[1] * (np.maximum(reflectance, _DARKEST) / _SURE) ** _POWER
        drawn_m = nominal_m * np.exp(np.float32(spread) * self._drawn(len(reflectance)))
        return np.asarray(np.minimum(drawn_m, RANGE_M[1]), np.float32)

    def _drawn(self, count: int) -> Float32s:
        return self._rng.standard_normal(count, np.float32)


def reflectances(view: View, soup: Soup) -> Float32s:
    """Return the share of light (N,) that comes back of what is seen: that of its colour, but for what is green."""
    hit = view.triangle != NO_TRIANGLE
    colour = SURFACE_COLOURS[view.surface].astype(np.float32)
    colour[hit] = soup.colour[view.triangle[hit]]
    grey = colour.mean(axis=1) / np.float32(255.0)
    linear = ((grey + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)  # sRGB, but for the darkest colours
    return np.where(_IS_GREEN[view.label], np.float32(_GREEN), linear)
