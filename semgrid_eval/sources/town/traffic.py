"""The road users and their traffic over time: who is where at any moment, from arrays mapped from disk."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.geometry import Floats
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.columns import Arrays, Columns

Shape = IntEnum("Shape", "CAR VAN TRUCK BUS BICYCLE PERSON", start=0)
"""How a road user looks; each has a model of its own."""
_CAR, _TRUCK, _BUS = LABEL_ID["car"], LABEL_ID["truck"], LABEL_ID["bus"]
_JUMP_M = 1.0  # nobody moves that far in one step of 59 ms; SUMO's pedestrians now and then do


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


_LENGTHS_M = np.array([user.length_m for user in ROAD_USERS], np.float32)
_IS_PERSON = np.array([user.shape is Shape.PERSON for user in ROAD_USERS])


@dataclass(frozen=True)
class Snapshot(Columns):
    """Everybody at one moment; all arrays have one row an actor."""

    actor: NDArray[np.int32]  # (A,) index of the actor in its town
    type_index: NDArray[np.uint8]  # (A,) index into `ROAD_USERS`
    centre_m: Floats  # (A, 2) centre of the footprint in the map frame
    yaw_rad: Floats  # (A,) counter-clockwise from the map's x axis
    velocity_mps: Floats  # (A, 2) in the map frame

    def __len__(self) -> int:
        return len(self.actor)


@dataclass(frozen=True)
class Traffic(Arrays):
    """SUMO's trajectories, sorted by time; rows `offsets[i]` to `offsets[i + 1]` belong to `times_s[i]`."""

    times_s: Floats  # (T,) times of the steps
    offsets: NDArray[np.int64]  # (T + 1,) first row of each step
    actor: NDArray[np.int32]  # (R,) index of the actor
    position_m: NDArray[np.float32]  # (R, 2) middle of the front bumper in the map frame (of a person: the person)
    heading_rad: NDArray[np.float32]  # (R,) counter-clockwise from the map's x axis
    speed_mps: NDArray[np.float32]  # (R,) along the heading
    actor_types: NDArray[np.uint8]  # (A,) index into `ROAD_USERS` of each actor

    def step_before(self, time_s: float) -> int:
        """Return the step at or before a time, such that a next step exists."""
        return int(np.clip(np.searchsorted(self.times_s, time_s, "right") - 1, 0, len(self.times_s) - 2))

    def at(self, time_s: float) -> Snapshot:
        """Interpolate everybody who is there in the step before and the step after to a time."""
        step = self.step_before(time_s)
        before, after = self._rows(step), self._rows(step + 1)
        _, first, second = np.intersect1d(self.actor[before], self.actor[after], True, return_indices=True)
        rows, next_rows = first + before.start, second + after.start
        span_s = self.times_s[step + 1] - self.times_s[step]
        share = float((time_s - self.times_s[step]) / span_s)
        actor = np.asarray(self.actor[rows])
        start, end = self._centres(rows), self._centres(next_rows)
        moved = end - start
        jumped = np.linalg.norm(moved, axis=1) > _JUMP_M
        moved[jumped] = 0.0
        yaw = self.heading_rad[rows].astype(np.float64)
        turn = _wrapped(self.heading_rad[next_rows].astype(np.float64) - yaw)
        return Snapshot(
            actor, np.asarray(self.actor_types[actor]), start + share * moved, yaw + share * turn, moved / span_s
        )

    def track(self, actor: int, first_step: int, end_step: int) -> tuple[Floats, Floats]:
        """Return one actor's front positions (S, 2) and headings (S,) over steps; NaN where it is not there."""
        positions = np.full((end_step - first_step, 2), np.nan)
        headings = np.full(end_step - first_step, np.nan)
        rows = np.arange(self.offsets[first_step], self.offsets[end_step])
        rows = rows[self.actor[rows[0] : rows[-1] + 1] == actor] if len(rows) else rows
        steps = np.searchsorted(self.offsets, rows, "right") - 1 - first_step
        positions[steps] = self.position_m[rows]
        headings[steps] = np.unwrap(self.heading_rad[rows].astype(np.float64))
        return positions, headings

    def _rows(self, step: int) -> slice:
        return slice(int(self.offsets[step]), int(self.offsets[step + 1]))

    def _centres(self, rows: NDArray[np.int64]) -> Floats:
        """Return the centres (N, 2) of the footprints: half a length behind the front bumper."""
        types = self.actor_types[self.actor[rows]]
        back_m = np.where(_IS_PERSON[types], 0.0, 0.5 * _LENGTHS_M[types])
        yaw = self.heading_rad[rows].astype(np.float64)
        ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        return np.asarray(self.position_m[rows].astype(np.float64) - back_m[:, None] * ahead)


def _wrapped(angle_rad: Floats) -> Floats:
    """Wrap angles to -pi..pi."""
    return (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
