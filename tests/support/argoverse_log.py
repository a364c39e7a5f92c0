"""Small logs in Argoverse's layout: a car ahead, one that stands, a pedestrian, and a box without points."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import feather

FRAMES, STEP_NS, START_NS = 6, 100_000_000, 315_966_253_000_000_000
CITY_M, YAW_RAD = (5000.0, 2400.0), 0.4
EGO_MPS, CAR_MPS = 10.0, 15.0
NAMES = {"a-car": "REGULAR_VEHICLE", "b-parked": "REGULAR_VEHICLE", "c-walker": "PEDESTRIAN", "d-hidden": "BUS"}


def ego(number: int) -> tuple[float, float]:
    """Where the vehicle is in the city."""
    way_m = EGO_MPS * number * STEP_NS * 1e-9
    return CITY_M[0] + way_m * math.cos(YAW_RAD), CITY_M[1] + way_m * math.sin(YAW_RAD)


def columns(frames: int = FRAMES) -> dict[str, list[Any]]:
    """The boxes, row by row in the order of time."""
    found: dict[str, list[Any]] = {}
    for number in range(frames):
        since_s = number * STEP_NS * 1e-9
        ahead_m = {
            "a-car": 20.0 + (CAR_MPS - EGO_MPS) * since_s,
            "b-parked": 30.0 - EGO_MPS * since_s,
            "c-walker": 15.0 - EGO_MPS * since_s,
            "d-hidden": 50.0,
        }
        for track, category in NAMES.items():
            row = {
                "timestamp_ns": START_NS + number * STEP_NS,
                "track_uuid": track,
                "category": category,
                "length_m": 0.8 if category == "PEDESTRIAN" else 4.5,
                "width_m": 0.7 if category == "PEDESTRIAN" else 1.9,
                "height_m": 1.7,
                **{"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0},
                "tx_m": ahead_m[track],
                "ty_m": {"b-parked": -4.0, "c-walker": 6.0}.get(track, 0.0),
                "tz_m": 0.8,
                "num_interior_pts": 0 if track == "d-hidden" else 25,
            }
            for name, value in row.items():
                found.setdefault(name, []).append(value)
    return found


def pose_columns(frames: int = FRAMES) -> dict[str, list[Any]]:
    """Poses, twice as often as there are boxes."""
    numbers = np.arange(0, frames, 0.5)
    turn = {"qw": math.cos(YAW_RAD / 2), "qx": 0.0, "qy": 0.0, "qz": math.sin(YAW_RAD / 2)}
    return {
        "timestamp_ns": [START_NS + int(number * STEP_NS) for number in numbers],
        **{name: [value] * len(numbers) for name, value in turn.items()},
        "tx_m": [ego(number)[0] for number in numbers],
        "ty_m": [ego(number)[1] for number in numbers],
        "tz_m": [60.0] * len(numbers),
    }


def city_map() -> dict[str, Any]:
    """A square of 400 m, and a crossing."""
    corners = [(-200, -200), (200, -200), (200, 200), (-200, 200)]
    boundary = [{"x": CITY_M[0] + x, "y": CITY_M[1] + y, "z": 60.0} for x, y in corners]
    edges = [[{"x": 5010.0, "y": y, "z": 0.0}, {"x": 5020.0, "y": y, "z": 0.0}] for y in (2400.0, 2404.0)]
    return {
        "drivable_areas": {"7": {"area_boundary": boundary, "id": 7}},
        "pedestrian_crossings": {"8": {"edge1": edges[0], "edge2": edges[1], "id": 8}},
        "lane_segments": {},
    }


def write_table(path: Path, content: dict[str, list[Any]]) -> None:
    """Write a feather file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pa.table(content), path)


def write_argoverse(
    root: Path, name: str = "drive", split: str = "val", *, frames: int = FRAMES, sweeps: bool = False
) -> Path:
    """Write a log, and return its folder."""
    folder = root / split / name
    write_table(folder / "annotations.feather", columns(frames))
    write_table(folder / "city_SE3_egovehicle.feather", pose_columns(frames))
    (folder / "map").mkdir()
    (folder / "map" / f"log_map_archive_{name}____PIT_city_1.json").write_text(json.dumps(city_map()))
    if sweeps:
        points = {"x": [1.5, -2.0], "y": [0.25, 3.0], "z": [0.0, 1.0]}
        halves: dict[str, Any] = {axis: pa.array(np.array(each, np.float16)) for axis, each in points.items()}
        path = folder / "sensors" / "lidar" / f"{START_NS + STEP_NS}.feather"
        write_table(path, {**halves, "intensity": pa.array([3, 200], pa.uint8())})
    return folder
