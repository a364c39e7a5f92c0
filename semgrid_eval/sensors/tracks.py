"""The boxes of actors and the map as a sensor: what annotators and maps say, as labelled points.

A cell is known where a point lies in it. Boxes are filled with points of their class if something of the actor was
seen; drivable area and crossings are filled with points of road, whoever can see them. Ground is left out beneath boxes
that give no point: those of which nothing was seen (label `unlabeled`), and those whose label has no grid class. So a
cell is unknown where there is neither map nor seen actor, and where an actor stands of whom it is not known what he is.
"""

import heapq
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Self

import numba
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from semgrid_eval.classes import NO_POINT
from semgrid_eval.errors import LogError
from semgrid_eval.geometry import SE2
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.topics import TRUE_ACTORS
from semgrid_eval.recording.road_map import RoadMap
from semgrid_eval.recording.types import Actor
from semgrid_eval.sensors.sensor import Morphology, Points, SensorConfig

if TYPE_CHECKING:
    from semgrid_eval.log.reader import LogReader

_MOST_POINTS = 2500  # ahead, behind, left and right
Floats = NDArray[np.float64]


class TracksSensor(SensorConfig):
    """Boxes of the log's actors, and its map where it has one."""

    kind: Literal["tracks"] = "tracks"
    morphology: Morphology | None = Field("off")  # outlines are exact already
    range_m: float = Field(120.0, gt=0.0, le=500.0)  # how far the ground is known ahead, behind, left and right
    spacing_m: float = Field(0.2, ge=0.05, le=1.0)  # of points, at most

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if self.range_m > _MOST_POINTS * self.spacing_m:
            raise ValueError(f"range_m {self.range_m:g} is more than {_MOST_POINTS} times spacing_m {self.spacing_m:g}")
        return self


def read_tracks(
    log: "LogReader", sensors: Mapping[str, TracksSensor], class_by_label: NDArray[np.uint8]
) -> Iterator[Points]:
    """Iterate over what sensors of tracks tell at each time of the log's actors, as `Kind` says."""
    road_map = log.road_map() or RoadMap((), ())
    poses = {pose.stamp_ns: SE2(pose.x_m, pose.y_m, pose.yaw_rad) for pose in log.poses()}
    streams = [_read(log, poses, _Sampler(name, each, road_map, class_by_label)) for name, each in sensors.items()]
    return heapq.merge(*streams, key=lambda points: points.stamp_ns)


def _read(log: "LogReader", poses: Mapping[int, SE2], sampler: "_Sampler") -> Iterator[Points]:
    for stamp_ns, actors in log.actors():
        if stamp_ns not in poses:
            raise LogError(f"has no true pose at {stamp_ns} ns", path=log.path)
        for actor in actors:
            if fault := actor.fault():
                place = f"{TRUE_ACTORS} at {stamp_ns} ns: actor {actor.actor_id}"
                raise LogError(fault, path=log.path, field=place)
        yield sampler.points(stamp_ns, actors, poses[stamp_ns])


@dataclass(frozen=True)
class _Sampler:
    """Fills boxes and ground with points."""

    name: str
    sensor: TracksSensor
    road_map: RoadMap
    class_by_label: NDArray[np.uint8]

    def points(self, stamp_ns: int, actors: tuple[Actor, ...], map_from_vehicle: SE2) -> Points:
        """Return the points of a time."""
        vehicle_from_map = map_from_vehicle.inverse()
        seen = [actor for actor in actors if self.class_by_label[actor.label_id] != NO_POINT]
        hidden = [actor for actor in actors if self.class_by_label[actor.label_id] == NO_POINT]
        places = [self._ground_m([vehicle_from_map.apply(_corners_m(each)) for each in hidden], vehicle_from_map)]
        classes = [np.full(len(places[0]), self.class_by_label[LABEL_ID["road"]])]
        for actor in seen:
            places.append(vehicle_from_map.apply(self._filling_m(actor)))
            classes.append(np.full(len(places[-1]), self.class_by_label[actor.label_id]))
        forward_m, left_m = np.concatenate(places).T
        return Points(self.name, stamp_ns, forward_m, left_m, np.concatenate(classes).astype(np.uint8))

    def _filling_m(self, actor: Actor) -> Floats:
        """Fill the box of an actor with points, evenly and at most `spacing_m` apart: (N, 2) in the map frame."""
        sides = [_middles_m(side_m, self.sensor.spacing_m) for side_m in (actor.length_m, actor.width_m)]
        along_m, across_m = (each.ravel() for each in np.meshgrid(*sides, indexing="ij"))
        return SE2(actor.x_m, actor.y_m, actor.yaw_rad).apply(np.stack([along_m, across_m], axis=-1))

    def _ground_m(self, hidden: list[Floats], vehicle_from_map: SE2) -> Floats:
        """Return points (N, 2) on drivable area and crossings, but for hidden polygons, in the vehicle frame."""
        cells = math.ceil(2 * self.sensor.range_m / self.sensor.spacing_m)
        ground = np.zeros((cells, cells), np.uint8)
        for polygon in (*self.road_map.drivable, *self.road_map.crossings):
            self._fill(ground, vehicle_from_map.apply(np.array(polygon)), 1)
        for corners_m in hidden:
            self._fill(ground, corners_m, 0)
        middles = np.argwhere(ground).astype(np.float64) + 0.5
        return middles * self.sensor.spacing_m - self.sensor.range_m

    def _fill(self, ground: NDArray[np.uint8], corners_m: Floats, value: int) -> None:
        """Fill a polygon (K, 2) in the vehicle frame; rows are ahead, columns left."""
        _fill_polygon((corners_m + self.sensor.range_m) / self.sensor.spacing_m, value, ground)


def _corners_m(actor: Actor) -> Floats:
    """Return the corners of a box (4, 2) in the map frame."""
    signs = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)])
    return SE2(actor.x_m, actor.y_m, actor.yaw_rad).apply(signs * (actor.length_m / 2, actor.width_m / 2))


def _middles_m(side_m: float, spacing_m: float) -> Floats:
    """Cut a side into equal parts of at most a length, and return their middles, from that of the side."""
    count = max(1, math.ceil(side_m / spacing_m))
    return np.asarray(((np.arange(count) + 0.5) / count - 0.5) * side_m, np.float64)


@numba.njit(cache=True, nogil=True)
def _fill_polygon(corners, value, ground):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Set what lies in a polygon, corners (K, 2): cells whose middles are inside (even-odd rule)."""
    rows, columns = ground.shape
    count = len(corners)
    crossings = np.empty(count)
    first_row = int(min(max(np.floor(corners[:, 0].min()), 0.0), rows))
    end_row = int(min(max(np.ceil(corners[:, 0].max()), 0.0), rows))
    for row in range(first_row, end_row):
        found = 0
        for k in range(count):
            (row0, column0), (row1, column1) = corners[k], corners[(k + 1) % count]
            if (row0 <= row + 0.5) != (row1 <= row + 0.5):
                crossings[found] = column0 + (row + 0.5 - row0) / (row1 - row0) * (column1 - column0)
                found += 1
        ends = np.minimum(np.maximum(np.ceil(np.sort(crossings[:found]) - 0.5), 0.0), float(columns))
        for pair in range(0, found - 1, 2):
            for column in range(int(ends[pair]), int(ends[pair + 1])):
                ground[row, column] = value
