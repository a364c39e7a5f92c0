"""The boxes of annotators and the poses of the vehicle: actors in the city frame, with their velocities."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.geometry import SE3
from semgrid_eval.recording.types import LONGEST_ACTOR_M, Actor, Pose
from semgrid_eval.sources.argoverse2.categories import LABEL_BY_CATEGORY, NOTHING_SEEN
from semgrid_eval.sources.argoverse2.tables import Table, read_table
from semgrid_eval.sources.poses import planar

POSE = dict.fromkeys(("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m"), "float64")
_SIZES = ("length_m", "width_m", "height_m")
_BOXES = {
    "timestamp_ns": "int64",
    "track_uuid": "string",
    "category": "string",
    **dict.fromkeys(_SIZES, "float64"),
    **POSE,
    "num_interior_pts": "int64",
}
_NEIGHBOUR_NS = 300_000_000
"""A track's boxes that are farther apart than three frames say nothing of its velocity."""
Floats = NDArray[np.float64]


def read_boxes(path: Path) -> Table:
    """Read `annotations.feather`, boxes in the vehicle frame of their time."""
    table = read_table(path, _BOXES)
    if not len(table["timestamp_ns"]):
        raise InputError("holds no box", path=path)
    for name in _SIZES:
        if len(wrong := np.flatnonzero(~((table[name] > 0) & (table[name] <= LONGEST_ACTOR_M)))):
            fault = f"row {wrong[0]}: {table[name][wrong[0]]:g} m is not within 0 to {LONGEST_ACTOR_M:g} m"
            raise InputError(fault, path=path, field=name)
    for row, category in enumerate(table["category"].tolist()):
        if category not in LABEL_BY_CATEGORY:
            raise InputError(f"row {row}: {category[:40]!r} is not one of Argoverse's", path=path, field="category")
    return table


def read_poses(path: Path, stamps_ns: list[int]) -> dict[int, SE3]:
    """Read where the vehicle is in the city at some times, from `city_SE3_egovehicle.feather`: city from vehicle."""
    table = read_table(path, {"timestamp_ns": "int64", **POSE})
    rows = {stamp_ns: row for row, stamp_ns in enumerate(table["timestamp_ns"].tolist())}
    for stamp_ns in stamps_ns:
        if stamp_ns not in rows:
            raise InputError(f"has no pose at {stamp_ns} ns, where there are boxes", path=path)
    return {stamp_ns: transform(table, rows[stamp_ns], path) for stamp_ns in stamps_ns}


def transform(table: Table, row: int, path: Path) -> SE3:
    """Return the transform in a row."""
    w, x, y, z, *place_m = (float(table[name][row]) for name in POSE)
    try:
        return SE3.from_quaternion((x, y, z, w), (place_m[0], place_m[1], place_m[2]))
    except ValueError as error:
        raise InputError(f"row {row}: {error}", path=path, field="qw, qx, qy, qz") from error


def actors_of(boxes: Table, poses: dict[int, SE3], path: Path) -> dict[int, tuple[Actor, ...]]:
    """Bring boxes into the city frame: actors by time, with the numbers of their tracks, from 1 on."""
    placed = [planar(int(boxes["timestamp_ns"][row]), each) for row, each in enumerate(_in_city(boxes, poses, path))]
    numbers = np.unique(boxes["track_uuid"].astype(str), return_inverse=True)[1] + 1
    velocity_mps = _velocities_mps(placed, numbers)
    found: dict[int, list[Actor]] = {stamp_ns: [] for stamp_ns in poses}
    for row, pose in enumerate(placed):
        seen = boxes["num_interior_pts"][row] > 0
        actor = Actor(
            actor_id=int(numbers[row]),
            label_id=LABEL_BY_CATEGORY[boxes["category"][row]] if seen else NOTHING_SEEN,
            x_m=pose.x_m,
            y_m=pose.y_m,
            yaw_rad=pose.yaw_rad,
            **{name: float(boxes[name][row]) for name in _SIZES},
            velocity_x_mps=float(velocity_mps[row, 0]),
            velocity_y_mps=float(velocity_mps[row, 1]),
        )
        found[pose.stamp_ns].append(actor)
    return {stamp_ns: tuple(sorted(actors, key=lambda each: each.actor_id)) for stamp_ns, actors in found.items()}


def _in_city(boxes: Table, poses: dict[int, SE3], path: Path) -> Iterator[SE3]:
    for row, stamp_ns in enumerate(boxes["timestamp_ns"].tolist()):
        yield poses[stamp_ns] @ transform(boxes, row, path)


def _velocities_mps(placed: list[Pose], numbers: NDArray[np.int64]) -> Floats:
    """Return the velocity of each box (N, 2): from the box before it to the one after it of the same track.

    At the ends of a track, and beside a gap, it is that from or to the box itself; zero where there is no other.
    """
    stamps_ns = np.array([pose.stamp_ns for pose in placed], np.int64)
    place_m = np.array([(pose.x_m, pose.y_m) for pose in placed])
    order = np.lexsort((stamps_ns, numbers))
    follows = (np.diff(numbers[order]) == 0) & (np.diff(stamps_ns[order]) <= _NEIGHBOUR_NS)
    here = np.arange(len(order))
    before, after = here - np.insert(follows, 0, False), here + np.append(follows, False)
    span_s = (stamps_ns[order][after] - stamps_ns[order][before]) * 1e-9
    way_m = place_m[order][after] - place_m[order][before]
    velocity_mps = np.zeros_like(place_m)
    known = span_s > 0
    velocity_mps[order[known]] = way_m[known] / span_s[known, None]
    return velocity_mps
