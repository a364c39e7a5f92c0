"""The sensors on a simulated vehicle: where they are, when they look, and what each makes of what it sees."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from semgrid_eval.geometry import Floats
from semgrid_eval.recording.lidar import Mount
from semgrid_eval.recording.types import CameraCalibration, Moment, Pose
from semgrid_eval.sources.benchmarks import RigName, Stereo
from semgrid_eval.sources.town.lidar import Lidar, LidarErrors, LidarNoise
from semgrid_eval.sources.town.picture_errors import FRONT, LIDAR, error_stream, recording_streams, sensor_streams
from semgrid_eval.sources.town.shading import Painter, draw_sunlight
from semgrid_eval.sources.town.stage import Stage, in_sight
from semgrid_eval.sources.town.stereo_camera import StereoCamera
from semgrid_eval.sources.town.traffic import Snapshot
from semgrid_eval.sources.town.varied import Conditions

STAMP_JITTER_S = 0.001
_WIDENING, _WIDENING_BEYOND = 0.55, 0.065  # aside for each metre ahead: at least, and beyond what a camera sees
ROOF = Mount((0.95, 0.0, 1.73), (0.0, 0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Clock:
    """How often a sensor looks, and how long after the front camera's first frame it looks first."""

    rate_hz: float
    offset_s: float

    def times_s(self, first_s: float, last_s: float, rng: np.random.Generator) -> Floats:
        """Return the times (K,) from a first to a last one, each off by the jitter of stamps."""
        even = np.arange(first_s + self.offset_s, last_s + 1.0, 1.0 / self.rate_hz)
        times_s = even + rng.normal(0.0, STAMP_JITTER_S, len(even))
        return times_s[times_s <= last_s]


@dataclass(frozen=True)
class Side:
    """A wide camera that does not look ahead."""

    place_m: tuple[float, float, float]  # of its left eye, in the vehicle frame
    yaw_rad: float

    def calibration(self, width_px: int, height_px: int) -> CameraCalibration:
        """Return its calibration for images of a size: a view of 110 degrees, looking down a little."""
        focal_px = 0.35 * width_px
        x_m, y_m, z_m = self.place_m
        return CameraCalibration(
            fx_px=focal_px,
            fy_px=focal_px,
            u0_px=0.5 * width_px - 0.5,
            v0_px=0.5 * height_px - 0.5,
            baseline_m=0.4,
            x_m=x_m,
            y_m=y_m,
            z_m=z_m,
            roll_rad=0.0,
            pitch_rad=0.12,
            yaw_rad=self.yaw_rad,
        )


SIDES = {
    "left": Side((1.9, 0.95, 1.0), math.radians(75.0)),
    "right": Side((1.9, -0.95, 1.0), math.radians(-75.0)),
    "rear": Side((-0.9, -0.2, 1.05), math.radians(180.0)),
}
RIGS: Mapping[RigName, tuple[str, ...]] = {
    "front": (FRONT,),
    "surround": (FRONT, *SIDES),
    "front+lidar": (FRONT, LIDAR),
    "surround+lidar": (FRONT, *SIDES, LIDAR),
}
"""The sensors of each rig; one that several have is the same in all, byte for byte."""
CLOCKS = {
    "left": Clock(10.0, 0.010),
    "rear": Clock(10.0, 0.043),
    "right": Clock(10.0, 0.077),
    LIDAR: Clock(10.0, 0.030),
}
"""Of all but the front camera; those around the vehicle look one after the other, as it is done to spread the load."""


class Sensor(Protocol):
    """What looks at a stage."""

    def observe(self, stage: Stage, others: Snapshot, time_s: float, pose: Pose) -> Moment:
        """Return what it makes of what it sees; must be called in the order of time."""


@dataclass(frozen=True)
class RigCamera:
    """A stereo camera and what paints its pictures."""

    name: str
    stereo: StereoCamera
    painters: Sequence[Painter]  # of each of its cameras
    widening: float | None = None  # see `in_sight`; None shows it everybody

    def observe(self, stage: Stage, others: Snapshot, time_s: float, pose: Pose) -> Moment:
        """Return a frame."""
        shown = others if self.widening is None else in_sight(others, pose, self.widening)
        scenery = stage.scenery(shown, time_s, pose)
        views = [scenery.seen_by(camera) for camera in self.stereo.cameras]
        images = [
            painter.paint(view, scenery.casters, scenery.movers)
            for painter, view in zip(self.painters, views, strict=True)
        ]
        frame = self.stereo.frame(pose.stamp_ns, list(zip(views, images, strict=True)))
        return Moment(pose.stamp_ns, {self.name: frame}, pose=pose)


@dataclass(frozen=True)
class RigLidar:
    """A LiDAR and its errors; all of a sweep is seen at one time."""

    lidar: Lidar
    errors: LidarErrors

    def observe(self, stage: Stage, others: Snapshot, time_s: float, pose: Pose) -> Moment:
        """Return a sweep."""
        scenery = stage.scenery(others, time_s, pose)
        sweep = self.errors.sweep(pose.stamp_ns, scenery.seen_by(self.lidar), scenery.soup)
        return Moment(pose.stamp_ns, {}, pose=pose, sweeps={LIDAR: sweep})


def conditions_of(camera: str, front: Conditions) -> Conditions:
    """Return what holds for a camera: that of the front one, but for where it is and how wide it sees."""
    if camera == FRONT:
        return front
    return replace(front, calibration=SIDES[camera].calibration(front.width_px, front.height_px))


def calibrations_of(rig: RigName, front: Conditions) -> dict[str, CameraCalibration]:
    """Return the calibrations of a rig's cameras by name."""
    return {name: conditions_of(name, front).calibration for name in RIGS[rig] if name != LIDAR}


def sensors_of(
    rig: RigName, front: Conditions, stereo: Stereo, seed: tuple[int, ...], stage: Stage
) -> dict[str, Sensor]:
    """Return the sensors of a recording by name."""
    sunlight = draw_sunlight(recording_streams(seed)[2])
    found: dict[str, Sensor] = {}
    for name in RIGS[rig]:
        errors = error_stream(seed, name)
        if name == LIDAR:
            found[name] = _lidar(stereo, errors)
            continue
        camera = StereoCamera(conditions_of(name, front), stereo, errors)
        painters = [Painter(each, sunlight, stage.still) for each in camera.cameras]
        widening = max(_WIDENING, front.side_slope + _WIDENING_BEYOND) if name == FRONT else None
        found[name] = RigCamera(name, camera, painters, widening)
    return found


def _lidar(stereo: Stereo, errors: np.random.Generator) -> RigLidar:
    lidar = Lidar(ROOF)
    return RigLidar(lidar, LidarErrors(lidar, None if stereo == "exact" else LidarNoise(), errors))


def looks_of(rig: RigName, seed: tuple[int, ...], front_s: Floats) -> list[tuple[float, str]]:
    """Return when each sensor of a rig looks, in the order of time.

    The front camera does at `front_s` (F,); the others by their clocks, from its first time to its last, between which
    the vehicle tells its motion.
    """
    looks = [(time_s, FRONT) for time_s in front_s.tolist()]
    for name in RIGS[rig]:
        if name != FRONT:
            times_s = CLOCKS[name].times_s(front_s[0], front_s[-1], sensor_streams(seed, name)[0])
            looks += [(time_s, name) for time_s in times_s.tolist()]
    return sorted(looks)
