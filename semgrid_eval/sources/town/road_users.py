"""The road users that SUMO moves: their types, sizes and labels."""

from dataclasses import dataclass
from enum import IntEnum

from semgrid_eval.classes import LABEL_ID


class Shape(IntEnum):
    """How a road user looks; each has a model of its own."""

    CAR = 0
    VAN = 1
    TRUCK = 2
    BUS = 3
    BICYCLE = 4
    PERSON = 5


@dataclass(frozen=True)
class RoadUser:
    """A type of road user; SUMO gets its size, the scene its shape, the truth its label."""

    name: str
    sumo_class: str
    shape: Shape
    label_id: int
    length_m: float
    width_m: float
    height_m: float
    share: float  # among the types of its SUMO class


_CAR, _TRUCK, _BUS = LABEL_ID["car"], LABEL_ID["truck"], LABEL_ID["bus"]
ROAD_USERS = (
    RoadUser("car_small", "passenger", Shape.CAR, _CAR, 3.9, 1.72, 1.48, 0.35),
    RoadUser("car_family", "passenger", Shape.CAR, _CAR, 4.6, 1.82, 1.46, 0.35),
    RoadUser("car_tall", "passenger", Shape.CAR, _CAR, 4.5, 1.85, 1.66, 0.18),
    RoadUser("van", "passenger", Shape.VAN, _CAR, 5.0, 1.95, 1.98, 0.12),
    RoadUser("truck_small", "truck", Shape.TRUCK, _TRUCK, 6.4, 2.2, 2.8, 0.5),
    RoadUser("truck_large", "truck", Shape.TRUCK, _TRUCK, 8.6, 2.5, 3.4, 0.5),
    RoadUser("bus", "bus", Shape.BUS, _BUS, 12.0, 2.55, 3.1, 1.0),
    RoadUser("bicycle", "bicycle", Shape.BICYCLE, LABEL_ID["bicycle"], 1.75, 0.6, 1.75, 1.0),
    RoadUser("person", "pedestrian", Shape.PERSON, LABEL_ID["person"], 0.4, 0.5, 1.75, 1.0),
)
CAR_TYPES = tuple(index for index, user in enumerate(ROAD_USERS) if user.sumo_class == "passenger")


def type_index(name: str) -> int:
    """Return the index in `ROAD_USERS` of the type with this name."""
    return [user.name for user in ROAD_USERS].index(name)
