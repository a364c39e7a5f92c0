"""The kinds of sensors, and what all of them saw at the times of one: who adds a kind adds its line to `KINDS`."""

import heapq
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, SerializeAsAny, StringConstraints

from semgrid_eval.classes import NO_POINT
from semgrid_eval.config import of_kind
from semgrid_eval.errors import AbsentSensorError
from semgrid_eval.log.topics import TRUE_ACTORS
from semgrid_eval.sensors.camera import CameraSensor, camera_frames, read_cameras
from semgrid_eval.sensors.lidar import LidarSensor, lidar_sweeps, read_lidars
from semgrid_eval.sensors.sensor import Kind, Points, SensorConfig
from semgrid_eval.sensors.tracks import TracksSensor, read_tracks

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader

KINDS: dict[str, Kind] = {
    "camera": Kind(CameraSensor, read_cameras, camera_frames),
    "lidar": Kind(LidarSensor, read_lidars, lidar_sweeps),
    "tracks": Kind(TracksSensor, read_tracks, lambda log, sensor: TRUE_ACTORS),
}
_DEFAULT_KIND = "camera"
TOLERANCE_NS = 1_000_000
"""Cameras that are triggered together do not stamp alike: what is this much later is taken for simultaneous."""


def _of_its_kind(value: object) -> object:
    return of_kind(value, {name: kind.config for name, kind in KINDS.items()}, _DEFAULT_KIND)


SensorName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Sensor = SerializeAsAny[Annotated[SensorConfig, BeforeValidator(_of_its_kind)]]
"""Settings of a sensor of any kind; `kind` tells which, a camera where it is left out."""


def read_points(
    log: "LogReader", sensors: Mapping[str, SensorConfig], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    """Iterate over what sensors of all kinds saw, in the order of time; `class_by_label` is as `Kind` says.

    Raises:
        LogError: the log is damaged or lacks what a sensor needs.
    """
    by_kind: dict[str, dict[str, SensorConfig]] = {}
    for name, sensor in sensors.items():
        by_kind.setdefault(sensor.kind, {})[name] = sensor
    streams = [KINDS[kind].read(log, chosen, class_by_label) for kind, chosen in by_kind.items()]
    return heapq.merge(*streams, key=lambda points: points.stamp_ns)


def times_of(log: "LogReader", sensor: SensorConfig) -> Iterator[int]:
    """Iterate over the times at which a sensor saw something, without looking at it where a topic tells them.

    Raises:
        LogError: as `read_points`.
    """
    kind = KINDS[sensor.kind]
    if kind.topic is None:
        points = kind.read(log, {sensor.kind: sensor}, np.full(256, NO_POINT, np.uint8))
        return (each.stamp_ns for each in points)
    return (stamp_ns for _, stamp_ns, _, _ in log.messages([kind.topic(log, sensor)]))


def misfit(log: "LogReader", sensors: Iterable[SensorConfig]) -> str | None:
    """Say why a log cannot have what sensors look at, before anything is looked at; None where it may.

    Raises:
        LogError: the log is damaged.
    """
    try:
        for sensor in sensors:
            if (topic := KINDS[sensor.kind].topic) is not None:
                topic(log, sensor)
    except AbsentSensorError as error:
        return str(error)
    return None


def synchronise(
    observations: Iterable[Points], sensors: Mapping[str, SensorConfig], leader: str
) -> Iterator[tuple[int, dict[str, Points]]]:
    """Iterate over the times of the leading sensor with the newest observation that each sensor had made by then.

    Observations are of all sensors, in the order of time; `sensors` say how old one may be: who has none is left out.
    """
    newest: dict[str, Points] = {}
    now: Points | None = None

    def snapshot(now: Points) -> tuple[int, dict[str, Points]]:
        ages_ns = {name: now.stamp_ns - points.stamp_ns for name, points in newest.items()}
        recent = [name for name, age_ns in ages_ns.items() if age_ns <= sensors[name].max_age_s * 1e9]
        return now.stamp_ns, {name: newest[name] for name in recent}

    for points in observations:
        if now is not None and (points.sensor == leader or points.stamp_ns > now.stamp_ns + TOLERANCE_NS):
            yield snapshot(now)
            now = None
        newest[points.sensor] = points
        if points.sensor == leader:
            now = points
    if now is not None:
        yield snapshot(now)
