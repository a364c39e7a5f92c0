"""The shapes that a scene is built from, as SUMO's network has them: lanes, junctions, walking areas, crossings."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import Floats

_DEFAULT_WIDTH_M = 3.2

LaneUse = Enum("LaneUse", "SIDEWALK PARKING BICYCLE CAR")
"""Whom a lane is for; a lane that nobody may drive on is the parking strip."""
_USES = {"pedestrian": LaneUse.SIDEWALK, "bicycle": LaneUse.BICYCLE}


@dataclass(frozen=True)
class Polyline:
    """A line through points (N, 2); distances along it run from 0 to `length_m`."""

    points_m: Floats
    distances_m: Floats

    @classmethod
    def through(cls, points_m: Floats) -> "Polyline":
        """Return the line through points (N, 2); repeated points are left out."""
        steps = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
        keep = np.append(True, steps > 1e-6)
        kept = points_m[keep]
        return cls(kept, np.append(0.0, np.cumsum(np.linalg.norm(np.diff(kept, axis=0), axis=1))))

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return float(self.distances_m[-1])

    def at(self, distance_m: float, left_m: float = 0.0) -> tuple[float, float, float]:
        """Return x, y and yaw at a distance along the line and an offset to its left."""
        segment = int(np.clip(np.searchsorted(self.distances_m, distance_m, "right") - 1, 0, len(self.points_m) - 2))
        start, end = self.points_m[segment], self.points_m[segment + 1]
        ahead = (end - start) / np.linalg.norm(end - start)
        x_m, y_m = start + (distance_m - self.distances_m[segment]) * ahead + left_m * np.array([-ahead[1], ahead[0]])
        return float(x_m), float(y_m), float(np.arctan2(ahead[1], ahead[0]))

    def piece(self, start_m: float, end_m: float, left_m: float = 0.0) -> Floats:
        """Return the points (M, 2) of the line between two distances, moved to its left."""
        inside = self.distances_m[(self.distances_m > start_m) & (self.distances_m < end_m)]
        return np.array([self.at(float(s), left_m)[:2] for s in (start_m, *inside, end_m)])


@dataclass(frozen=True)
class Lane:
    """A lane in driving direction: centre line (N, 2) in the map frame, and the street direction it belongs to."""

    use: LaneUse
    edge: str
    line_m: Floats
    width_m: float
    ends_at_light: bool


@dataclass(frozen=True)
class Network:
    """The shapes of a town; polygons and lines are (N, 2) in the map frame (x east, y north)."""

    lanes: tuple[Lane, ...]
    junctions_m: tuple[Floats, ...]
    walking_areas_m: tuple[Floats, ...]
    crossings: tuple[tuple[Floats, float], ...]  # centre line, width

    def bounds_m(self) -> tuple[float, float, float, float]:
        """Return least x, least y, most x, most y of all lanes and junctions."""
        points = np.concatenate([*(lane.line_m for lane in self.lanes), *self.junctions_m])
        low, high = points.min(axis=0), points.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def street_km(self) -> float:
        """Return the length of all streets, each counted once for both directions."""
        sidewalks = (lane.line_m for lane in self.lanes if lane.use is LaneUse.SIDEWALK)
        return sum(float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in sidewalks) / 2000.0


def read_network(path: Path) -> Network:
    """Read a `.net.xml` file, which must have a street."""
    root = ET.parse(path).getroot()
    junctions = [node for node in root.iter("junction") if node.get("type") != "internal" and node.get("shape")]
    lights = {node.attrib["id"] for node in junctions if node.get("type") == "traffic_light"}
    lanes = tuple(_lane(lane, edge, ends_at_light=edge.get("to") in lights) for edge, lane in _lanes(root, None))
    if not lanes:
        raise InputError("the town is empty: SUMO kept no street", path=path)
    crossings = (lane for _, lane in _lanes(root, "crossing"))
    walking = (lane for _, lane in _lanes(root, "walkingarea"))
    return Network(
        lanes=lanes,
        junctions_m=tuple(_points(node) for node in junctions if len(_points(node)) >= 3),
        walking_areas_m=tuple(_points(lane) for lane in walking if len(_points(lane)) >= 3),
        crossings=tuple((_points(lane), float(lane.get("width", _DEFAULT_WIDTH_M))) for lane in crossings),
    )


def _lanes(root: ET.Element, function: str | None) -> Iterator[tuple[ET.Element, ET.Element]]:
    """Find the edges of a function, None for streets, and their lanes."""
    for edge in root.iter("edge"):
        if edge.get("function") == function:
            yield from ((edge, lane) for lane in edge.iter("lane"))


def _points(element: ET.Element) -> Floats:
    """Return the shape (N, 2); heights, where SUMO writes them, are dropped."""
    return np.array([[float(value) for value in point.split(",")[:2]] for point in element.attrib["shape"].split()])


def _lane(lane: ET.Element, edge: ET.Element, *, ends_at_light: bool) -> Lane:
    use = LaneUse.PARKING if lane.get("disallow") == "all" else _USES.get(lane.get("allow", ""), LaneUse.CAR)
    width_m = float(lane.get("width", _DEFAULT_WIDTH_M))
    return Lane(use, edge.attrib["id"], _points(lane), width_m, ends_at_light)
