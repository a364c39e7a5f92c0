"""The kinds of town: what distinguishes a dense centre from a boulevard, a suburb or an arterial road."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class TownKind:
    """Numbers that shape a town's streets, its frontage and its traffic; shares are probabilities in 0..1."""

    name: str  # as it stands in the documentation
    block_m: float  # length of a street between two junctions
    jitter_m: float  # standard deviation of a junction's displacement from the regular grid
    dropped_streets: float  # share of the grid's streets that are left out
    bent_streets: float  # share of streets that curve
    two_lanes: float  # share of streets with two car lanes a direction
    bicycle_lanes: float  # share of streets with a bicycle lane
    parking_strips: float  # share of streets with a parking strip
    parked: float  # share of a strip's places that are taken
    traffic_lights: float  # share of junctions with traffic lights
    frontage: float  # share of parcels that hold a building
    setback_m: tuple[float, float]  # from the sidewalk to the facades, drawn a street (least, most)
    floors: tuple[int, int]  # of a building (least, most)
    parcel_m: tuple[float, float]  # width of a parcel (least, most)
    tree_rows: float  # share of streets with a row of trees on the sidewalk
    hedges: float  # share of the frontage's open parts with a hedge, and ...
    fences: float  # ... with a wall or fence
    cars: float  # moving at a time, a kilometre of street; likewise trucks, buses, bicycles and persons
    trucks: float
    buses: float
    bicycles: float
    persons: float


_NAMES = ("centre", "boulevard", "suburb", "arterial")
_TABLE: dict[str, tuple[Any, ...]] = {
    "block_m": (105, 130, 115, 150),
    "jitter_m": (11, 10, 14, 16),
    "dropped_streets": (0.10, 0.12, 0.15, 0.15),
    "bent_streets": (0.35, 0.45, 0.60, 0.60),
    "two_lanes": (0.10, 0.50, 0.08, 0.60),
    "bicycle_lanes": (0.50, 0.70, 0.35, 0.60),
    "parking_strips": (0.75, 0.65, 0.60, 0.35),
    "parked": (0.75, 0.65, 0.50, 0.50),
    "traffic_lights": (0.55, 0.65, 0.30, 0.60),
    "frontage": (0.93, 0.85, 0.75, 0.55),
    "setback_m": ((0.0, 0.6), (0.5, 5.0), (2.5, 7.0), (3.0, 10.0)),
    "floors": ((3, 6), (3, 6), (1, 3), (1, 5)),
    "parcel_m": ((9, 20), (12, 26), (12, 22), (14, 34)),
    "tree_rows": (0.45, 0.75, 0.35, 0.65),
    "hedges": (0.25, 0.35, 0.55, 0.40),
    "fences": (0.35, 0.30, 0.35, 0.40),
    "cars": (13.0, 15.0, 13.0, 16.0),
    "trucks": (3.0, 3.0, 3.0, 4.5),
    "buses": (2.5, 3.0, 2.5, 2.5),
    "bicycles": (19.0, 19.0, 19.0, 19.0),
    "persons": (90.0, 90.0, 65.0, 65.0),
}
KINDS = tuple(
    TownKind(name, **dict(zip(_TABLE, values, strict=True)))
    for name, values in zip(_NAMES, zip(*_TABLE.values(), strict=True), strict=True)
)
