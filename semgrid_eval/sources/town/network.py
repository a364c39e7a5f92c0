"""Reads a SUMO network into the shapes that a scene is built from: lanes, junctions, walking areas, crossings."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import Floats

_DEFAULT_WIDTH_M = 3.2


class LaneUse(Enum):
    """Whom a lane is for; a lane that nobody may drive on is the parking strip."""

    SIDEWALK = "sidewalk"
    PARKING = "parking"
    BICYCLE = "bicycle"
    CAR = "car"


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
    """Read a `.net.xml` file.

    Raises:
        InputError: the town has no street.
    """
    root = ET.parse(path).getroot()
    junctions = [node for node in root.iter("junction") if node.get("type") != "internal" and node.get("shape")]
    lights = {node.attrib["id"] for node in junctions if node.get("type") == "traffic_light"}
    edges = list(root.iter("edge"))
    lanes = tuple(
        _lane(lane, edge, ends_at_light=edge.get("to") in lights)
        for edge in edges
        if edge.get("function") is None
        for lane in edge.iter("lane")
    )
    if not lanes:
        raise InputError("the town is empty: SUMO kept no street", path=path)
    crossings = (lane for edge in edges if edge.get("function") == "crossing" for lane in edge.iter("lane"))
    walking = (lane for edge in edges if edge.get("function") == "walkingarea" for lane in edge.iter("lane"))
    return Network(
        lanes=lanes,
        junctions_m=tuple(_points(node) for node in junctions if len(_points(node)) >= 3),
        walking_areas_m=tuple(_points(lane) for lane in walking if len(_points(lane)) >= 3),
        crossings=tuple((_points(lane), float(lane.get("width", _DEFAULT_WIDTH_M))) for lane in crossings),
    )


def _points(element: ET.Element) -> Floats:
    """Return the shape (N, 2); heights, where SUMO writes them, are dropped."""
    return np.array([[float(value) for value in point.split(",")[:2]] for point in element.attrib["shape"].split()])


def _lane(lane: ET.Element, edge: ET.Element, *, ends_at_light: bool) -> Lane:
    allow, disallow = lane.get("allow"), lane.get("disallow")
    if disallow == "all":
        use = LaneUse.PARKING
    elif allow == "pedestrian":
        use = LaneUse.SIDEWALK
    elif allow == "bicycle":
        use = LaneUse.BICYCLE
    else:
        use = LaneUse.CAR
    width_m = float(lane.get("width", _DEFAULT_WIDTH_M))
    return Lane(use, edge.attrib["id"], _points(lane), width_m, ends_at_light)
