"""LiDARs whose points have labels, or get them of a camera: each sweep is an observation of its own time."""

import heapq
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from semgrid_eval.classes import NO_POINT
from semgrid_eval.config import Config
from semgrid_eval.errors import LogError
from semgrid_eval.faults import shown
from semgrid_eval.log.topics import lidar_topic
from semgrid_eval.sensors.sensor import Morphology, Points, SensorConfig

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader
    from semgrid_eval.recording.lidar import LidarSweep


class ColourFrom(Config):
    """Which cameras' label images colour points, and which of their pixels."""

    # Its name in the log, or names: a point has the label of the first that sees it. None takes a log's only one.
    camera: str | tuple[str, ...] | None = None
    within_s: float = Field(0.1, ge=0.0, le=1.0)  # of a sweep, before or after it: the nearest label image in that time
    # How far beside a point a nearer one hides it, in the middle of the image: more than half the angle between rings.
    occlusion_rad: float = Field(0.0057, ge=0.0, le=0.05)

    @field_validator("camera", mode="before")
    @classmethod
    def _is_named(cls, value: object) -> object:
        if value is None or isinstance(value, str):
            return value
        if isinstance(value, list | tuple) and value and all(isinstance(name, str) for name in value):
            return tuple(value)
        raise ValueError(f"must be a name or a list of names, not {shown(value)}")

    @property
    def cameras(self) -> tuple[str | None, ...]:
        """The cameras in their order; None is a log's only one."""
        return self.camera if isinstance(self.camera, tuple) else (self.camera,)


class LidarSensor(SensorConfig):
    """All points of a LiDAR that have a label of a grid class, their own or a camera's."""

    kind: Literal["lidar"] = "lidar"
    lidar: str | None = None  # its name in the log; None takes a log's only one
    # The paper's kernels close gaps of one cell and then delete what is less than four cells wide. Rings on the ground
    # are one cell wide and farther apart than that, from some 15 m on for 64 rings: so nothing is done by default.
    morphology: Morphology | None = Field("off")
    # The cameras whose label images colour the points. None takes the points' own labels, and is not written, so that
    # grids of these keep their digests.
    colour_from: ColourFrom | None = Field(None, exclude_if=lambda value: value is None)


def read_lidars(
    log: "LogReader", sensors: Mapping[str, LidarSensor], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    """Iterate over what LiDARs see, each sweep decoded once, as `Kind` says."""
    by_lidar: dict[str, dict[str, LidarSensor]] = {}
    for name, sensor in sensors.items():
        by_lidar.setdefault(log.choose_lidar(sensor.lidar), {})[name] = sensor
    streams = [_read_lidar(log, lidar, chosen, class_by_label) for lidar, chosen in by_lidar.items()]
    return heapq.merge(*streams, key=lambda points: points.stamp_ns)


def lidar_sweeps(log: "LogReader", sensor: LidarSensor) -> str:
    """Return the topic of a sensor's sweeps; an AbsentSensorError says that it, or its camera, is not there."""
    for camera in sensor.colour_from.cameras if sensor.colour_from else ():
        log.choose_camera(camera)
    return lidar_topic(log.choose_lidar(sensor.lidar))


def _read_lidar(
    log: "LogReader", lidar: str, sensors: Mapping[str, LidarSensor], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    # Whoever reads settings alone does not wait for a compiler.
    from semgrid_eval.sensors.colouring import Colouring

    colourings = {name: Colouring(log, each.colour_from) for name, each in sensors.items() if each.colour_from}
    for sweep in log.sweeps(lidar):
        place_m = _in_vehicle(sweep)
        for name in sensors:
            if name in colourings:
                coloured = colourings[name].colour(sweep.stamp_ns, place_m)
                class_id = np.where(coloured.seen, class_by_label[coloured.label_id], np.uint8(NO_POINT))
            else:
                class_id = class_by_label[_own_labels(log, lidar, sweep)]
            yield Points(name, sweep.stamp_ns, place_m[:, 0], place_m[:, 1], class_id)


def _own_labels(log: "LogReader", lidar: str, sweep: "LidarSweep") -> NDArray[np.uint8]:
    if sweep.label_id is None:
        place = f"sweep of {lidar} at {sweep.stamp_ns} ns"
        message = "has no labels; a grid needs them, or `colour_from`: a camera whose label images colour the points"
        raise LogError(message, path=log.path, field=place)
    return sweep.label_id


def _in_vehicle(sweep: "LidarSweep") -> NDArray[np.float64]:
    """Bring the points of a sweep into the vehicle frame: (N, 3)."""
    return sweep.mount.ego_from_sensor.apply(sweep.points_m.astype(np.float64))
