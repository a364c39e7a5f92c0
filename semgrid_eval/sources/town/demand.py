"""Who travels in a town, and when: SUMO's random trips, thinned out over time so that the streets fill at once."""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import numpy as np

from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.road_users import ROAD_USERS
from semgrid_eval.sources.town.sumo import run_tool

FILL_S = 24.0
"""Time in which the streets are filled; from then on as many depart as arrive."""
TYPES_FILE = "types.add.xml"
_FAR = ("--min-distance", "200")


class _Stream(NamedTuple):
    """Trips over one kind of lane: SUMO's classes that travel it, how long a trip takes, and options of the tool."""

    permission: str
    classes: tuple[str, ...]
    trip_s: float
    options: tuple[str, ...]

    @property
    def file(self) -> str:
        return f"{self.permission}.trips.xml"


_STREAMS = (
    _Stream("passenger", ("passenger", "truck", "bus"), 75.0, _FAR),
    _Stream("bicycle", ("bicycle",), 90.0, _FAR),
    _Stream("pedestrian", ("pedestrian",), 170.0, ("--persons",)),
)


def write_demand(network: Path, kind: TownKind, street_km: float, end_s: float, rng: np.random.Generator) -> list[str]:
    """Write types and trips of everybody beside the network and return the names of the files of trips.

    Raises:
        InputError: SUMO's tool failed.
    """
    _write_types(network.parent / TYPES_FILE)
    density = {"passenger": kind.cars, "truck": kind.trucks, "bus": kind.buses}
    density |= {"bicycle": kind.bicycles, "pedestrian": kind.persons}
    for stream in _STREAMS:
        users = [user for user in ROAD_USERS if user.sumo_class in stream.classes]
        per_km = {user.name: density[user.sumo_class] * user.share for user in users}
        _write_trips(network, stream, per_km, street_km, end_s, rng)
    return [stream.file for stream in _STREAMS]


def _write_types(path: Path) -> None:
    root = ET.Element("additional")
    for user in ROAD_USERS:
        size = {"length": str(user.length_m), "width": str(user.width_m), "height": str(user.height_m)}
        size = {} if user.sumo_class == "pedestrian" else size  # SUMO's own size steers how people evade each other
        ET.SubElement(root, "vType", {"id": user.name, "vClass": user.sumo_class, **size})
    ET.ElementTree(root).write(path)


def _write_trips(
    network: Path, stream: _Stream, per_km: dict[str, float], street_km: float, end_s: float, rng: np.random.Generator
) -> None:
    """Draw trips, then set who makes each and when: enough to fill the streets at once, then as many as arrive."""
    users, weights = list(per_km), np.array(list(per_km.values()))
    at_a_time = max(1, round(float(weights.sum()) * street_km))
    count = at_a_time + round(at_a_time * end_s / stream.trip_s)
    options = ["-n", network.name, "-o", stream.file, "--seed", str(int(rng.integers(1 << 30)))]
    options += ["--prefix", stream.permission, "--begin", "0", "--end", str(count), "--period", "1", "--no-validate"]
    run_tool("randomTrips", [*options, "--edge-permission", stream.permission, *stream.options], network.parent)
    path = network.parent / stream.file
    tree = ET.parse(path)
    trips = [node for node in tree.getroot() if node.tag in ("trip", "person")]
    for index, trip in enumerate(trips):
        is_first = index < at_a_time
        late_s = (index - at_a_time) * stream.trip_s / at_a_time
        trip.set("depart", f"{FILL_S * index / at_a_time if is_first else FILL_S + late_s:.2f}")
        trip.set("type", users[int(rng.choice(len(users), p=weights / weights.sum()))])
        if trip.tag == "person":
            trip.set("departPos", "random")
        else:
            trip.attrib.update(departLane="best", departSpeed="max", departPos="random_free" if is_first else "base")
    tree.write(path)
