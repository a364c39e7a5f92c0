"""Where a map says that the ground can be driven on, and where people cross; kept in a log as a file of its own."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

FILE = "road_map.json"
"""Name of the attachment of a log."""
MAX_CORNERS = 1_000_000
_FARTHEST_M = 1e7
Polygon = tuple[tuple[float, float], ...]
"""Corners (x, y) in the map frame of `Pose`, in metres; the last is joined with the first."""


@dataclass(frozen=True)
class RoadMap:
    """The parts of a map that grids know."""

    drivable: tuple[Polygon, ...]  # where vehicles can drive
    crossings: tuple[Polygon, ...]  # where pedestrians cross the road

    def to_json(self) -> bytes:
        """Return what `from_json` reads."""
        return json.dumps({"drivable": self.drivable, "crossings": self.crossings}).encode()

    @classmethod
    def from_json(cls, data: bytes) -> "RoadMap":
        """Read a map.

        Raises:
            ValueError: it is not one, has more than `MAX_CORNERS` corners, or one is not a finite place.
        """
        given = json.loads(data)
        if not isinstance(given, dict) or given.keys() != {"drivable", "crossings"}:
            raise ValueError("a map has the keys drivable and crossings")
        found = {name: tuple(_polygon(each) for each in _list(given[name])) for name in given}
        if sum(len(polygon) for polygons in found.values() for polygon in polygons) > MAX_CORNERS:
            raise ValueError(f"a map has more than {MAX_CORNERS} corners")
        return cls(**found)


def _polygon(given: Any) -> Polygon:  # noqa: ANN401 - anything that JSON can hold
    corners = tuple(_corner(each) for each in _list(given))
    if len(corners) < 3:
        raise ValueError(f"a polygon of a map has {len(corners)} corners")
    return corners


def _corner(given: Any) -> tuple[float, float]:  # noqa: ANN401
    x_m, y_m = _list(given)
    if not all(type(each) in (int, float) and math.isfinite(each) and abs(each) <= _FARTHEST_M for each in (x_m, y_m)):
        raise ValueError(f"a corner of a map is at {str(given)[:40]}")
    return float(x_m), float(y_m)


def _list(given: Any) -> Sequence[Any]:  # noqa: ANN401
    if not isinstance(given, list):
        raise ValueError(f"{str(given)[:40]} in a map is not a list")
    return given
