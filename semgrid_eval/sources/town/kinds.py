"""The kinds of town: what distinguishes a dense centre from a boulevard, a suburb or an arterial road."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TownKind:
    """Numbers that shape a town's streets, its frontage and its traffic; shares are probabilities in 0..1.

    Args:
        name: as it stands in the documentation.
        block_m: length of a street between two junctions.
        jitter_m: standard deviation of a junction's displacement from the regular grid.
        dropped_streets: share of the grid's streets that are left out.
        bent_streets: share of streets that curve.
        two_lanes: share of streets with two car lanes a direction.
        bicycle_lanes: share of streets with a bicycle lane.
        parking_strips: share of streets with a parking strip.
        parked: share of a strip's places that are taken.
        traffic_lights: share of junctions with traffic lights.
        frontage: share of parcels that hold a building.
        setback_m: from the sidewalk to the facades, drawn a street (least, most).
        floors: of a building (least, most).
        parcel_m: width of a parcel (least, most).
        tree_rows: share of streets with a row of trees on the sidewalk.
        hedges: share of the frontage's open parts with a hedge, and ...
        fences: ... with a wall or fence.
        cars: moving at a time, a kilometre of street; likewise trucks, buses, bicycles and persons.
    """

    name: str
    block_m: float
    jitter_m: float
    dropped_streets: float
    bent_streets: float
    two_lanes: float
    bicycle_lanes: float
    parking_strips: float
    parked: float
    traffic_lights: float
    frontage: float
    setback_m: tuple[float, float]
    floors: tuple[int, int]
    parcel_m: tuple[float, float]
    tree_rows: float
    hedges: float
    fences: float
    cars: float = 13.0
    trucks: float = 3.0
    buses: float = 2.5
    bicycles: float = 19.0
    persons: float = 90.0


KINDS = (
    TownKind(
        "centre",
        block_m=105,
        jitter_m=11,
        dropped_streets=0.10,
        bent_streets=0.35,
        two_lanes=0.10,
        bicycle_lanes=0.50,
        parking_strips=0.75,
        parked=0.75,
        traffic_lights=0.55,
        frontage=0.93,
        setback_m=(0.0, 0.6),
        floors=(3, 6),
        parcel_m=(9, 20),
        tree_rows=0.45,
        hedges=0.25,
        fences=0.35,
    ),
    TownKind(
        "boulevard",
        block_m=130,
        jitter_m=10,
        dropped_streets=0.12,
        bent_streets=0.45,
        two_lanes=0.50,
        bicycle_lanes=0.70,
        parking_strips=0.65,
        parked=0.65,
        traffic_lights=0.65,
        frontage=0.85,
        setback_m=(0.5, 5.0),
        floors=(3, 6),
        parcel_m=(12, 26),
        tree_rows=0.75,
        hedges=0.35,
        fences=0.30,
        cars=15.0,
        buses=3.0,
    ),
    TownKind(
        "suburb",
        block_m=115,
        jitter_m=14,
        dropped_streets=0.15,
        bent_streets=0.60,
        two_lanes=0.08,
        bicycle_lanes=0.35,
        parking_strips=0.60,
        parked=0.50,
        traffic_lights=0.30,
        frontage=0.75,
        setback_m=(2.5, 7.0),
        floors=(1, 3),
        parcel_m=(12, 22),
        tree_rows=0.35,
        hedges=0.55,
        fences=0.35,
        persons=65.0,
    ),
    TownKind(
        "arterial",
        block_m=150,
        jitter_m=16,
        dropped_streets=0.15,
        bent_streets=0.60,
        two_lanes=0.60,
        bicycle_lanes=0.60,
        parking_strips=0.35,
        parked=0.50,
        traffic_lights=0.60,
        frontage=0.55,
        setback_m=(3.0, 10.0),
        floors=(1, 5),
        parcel_m=(14, 34),
        tree_rows=0.65,
        hedges=0.40,
        fences=0.40,
        cars=16.0,
        trucks=4.5,
        persons=65.0,
    ),
)
