"""Small logs in Argoverse's layout: a car ahead, one that stands, a pedestrian, and a box without points."""

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import feather

from semgrid_eval.geometry import rotation_of

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


STEREO = {
    "stereo_front_left": (
        (1689.592559, 1024.542828, 763.972562, -0.284888, -0.027553, 0.094135),
        (0.500842, -0.499026, 0.500668, -0.499461, 1.625064, 0.250715, 1.190953),
    ),
    "stereo_front_right": (
        (1690.515378, 1023.948054, 767.021130, -0.282783, -0.036770, 0.104836),
        (0.503349, -0.499190, 0.498505, -0.498941, 1.630594, -0.247706, 1.190142),
    ),
}
"""Focal length, principal point and lens, then turn and place, of the pair of a real log."""
RING = {
    "ring_front_center": (
        (1776.041484, 777.990573, 1013.524325, -0.240732, -0.212243, 0.325902),
        (0.501645, -0.498620, 0.501070, -0.498657, 1.635018, 0.002676, 1.397967),
    ),
    "ring_rear_left": (
        (1683.942719, 1029.043729, 765.769259, -0.275489, -0.053898, 0.118793),
        (0.601889, -0.603460, -0.369956, 0.369727, 1.090193, 0.126106, 1.418716),
    ),
}
"""Likewise of two of the ring cameras, of which the first is turned upright."""
STEREO_SIZE, STEREO_SCALE = (512, 388), 0.25
PLANE_M = 12.0
"""How far ahead of the rear axle the upright plane stands that the pair sees."""
STEREO_STEP_NS, STEREO_OFFSET_NS, APART_NS = 50_000_000, 20_000_000, 1_000_000


def size_of(name: str) -> tuple[int, int]:
    """Width and height of the images of a camera."""
    return STEREO_SIZE[::-1] if name == "ring_front_center" else STEREO_SIZE


def camera_tables(cameras: dict[str, Any] = STEREO) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
    """Intrinsics of cameras, their images a quarter as large as the real ones, and extrinsics."""
    intrinsics: dict[str, list[Any]] = {"sensor_name": list(cameras)}
    numbers = np.array([lens for lens, _ in cameras.values()])
    scaled = numbers[:, [0, 0, 1, 2]] * STEREO_SCALE
    for name, column in zip(("fx_px", "fy_px", "cx_px", "cy_px"), scaled.T, strict=True):
        intrinsics[name] = column.tolist()
    for name, column in zip(("k1", "k2", "k3"), numbers[:, 3:].T, strict=True):
        intrinsics[name] = column.tolist()
    intrinsics["width_px"], intrinsics["height_px"] = map(list, zip(*map(size_of, cameras), strict=True))
    places: dict[str, list[Any]] = {"sensor_name": list(cameras)}
    for number, name in enumerate(("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")):
        places[name] = [place[number] for _, place in cameras.values()]
    return intrinsics, places


def on_wall(name: str, plane_m: float) -> NDArray[np.float64]:
    """Where the pixels of a camera meet a wall, upright and across the way, without distortion: (H, W, 3) x, y, z."""
    (focal_px, u0_px, v0_px, *_), (w, x, y, z, *place_m) = {**STEREO, **RING}[name]
    columns, rows = np.meshgrid(*map(np.arange, size_of(name)))
    f_px, u_px, v_px = (each * STEREO_SCALE for each in (focal_px, u0_px, v0_px))
    rays = np.stack([(columns - u_px) / f_px, (rows - v_px) / f_px, np.ones(rows.shape)], axis=-1)
    rays = rays @ rotation_of((x, y, z, w)).T
    return np.asarray(rays * ((plane_m - place_m[0]) / rays[..., :1]) + np.array(place_m))


def stereo_image(name: str) -> NDArray[np.uint8]:
    """What a camera of the pair sees of a wall with spots."""
    across = on_wall(name, PLANE_M)
    spots = np.random.default_rng(1).integers(0, 256, (400, 400), np.uint8)
    spots = cv2.GaussianBlur(spots, (0, 0), 1.2)
    spots = cv2.normalize(spots, None, 0, 255, cv2.NORM_MINMAX)
    at = [(across[..., axis] * 20 + 200).astype(np.float32) for axis in (1, 2)]
    return np.asarray(cv2.remap(spots, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), np.uint8)


RED, BLUE = (0, 0, 255), (255, 0, 0)  # as OpenCV has them
WALLS = {"ring_front_center": (PLANE_M, 0.5, (BLUE, RED)), "ring_rear_left": (-PLANE_M, 5.0, (RED, BLUE))}
"""What the ring cameras see: how far ahead a wall stands, where its colour changes, and the left and the right one."""
RING_OFFSET_NS = 5_000_000


def ring_image(name: str) -> NDArray[np.uint8]:
    """What a ring camera sees of its wall."""
    plane_m, edge_m, (left, right) = WALLS[name]
    is_left = on_wall(name, plane_m)[..., 1:2] > edge_m
    return np.where(is_left, left, right).astype(np.uint8)


def write_ring(folder: Path) -> None:
    """Write images of the ring cameras, twice for each time of boxes and a little after it."""
    for name in RING:
        image = ring_image(name)
        images = folder / "sensors" / "cameras" / name
        images.mkdir(parents=True)
        for number in range(4):
            stamp_ns = START_NS + RING_OFFSET_NS + number * STEREO_STEP_NS
            cv2.imwrite(str(images / f"{stamp_ns}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 95])


def write_calibration(folder: Path, cameras: dict[str, Any]) -> None:
    """Write intrinsics and extrinsics of cameras."""
    for name, content in zip(("intrinsics", "egovehicle_SE3_sensor"), camera_tables(cameras), strict=True):
        write_table(folder / "calibration" / f"{name}.feather", content)


def write_stereo(folder: Path) -> None:
    """Write images of the pair, by their own clock and the right ones a little late."""
    for name, late_ns in zip(STEREO, (0, APART_NS), strict=True):
        image = stereo_image(name)
        images = folder / "sensors" / "cameras" / name
        images.mkdir(parents=True)
        for number in range(4):
            stamp_ns = START_NS + STEREO_OFFSET_NS + number * STEREO_STEP_NS + late_ns
            cv2.imwrite(str(images / f"{stamp_ns}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 95])


def write_small_images(images: Path, camera: str = "stereo_front_left") -> None:
    """Make the images of a camera smaller than its calibration says."""
    for path in sorted((images / camera).iterdir()):
        cv2.imwrite(str(path), np.zeros((100, 200), np.uint8))


def write_table(path: Path, content: dict[str, list[Any]]) -> None:
    """Write a feather file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pa.table(content), path)


def write_argoverse(
    root: Path,
    name: str = "drive",
    split: str = "val",
    *,
    frames: int = FRAMES,
    sweeps: bool = False,
    stereo: bool = False,
    ring: bool = False,
) -> Path:
    """Write a log, and return its folder."""
    folder = root / split / name
    write_table(folder / "annotations.feather", columns(frames))
    write_table(folder / "city_SE3_egovehicle.feather", pose_columns(frames))
    (folder / "map").mkdir()
    (folder / "map" / f"log_map_archive_{name}____PIT_city_1.json").write_text(json.dumps(city_map()))
    if stereo or ring:
        write_calibration(folder, {**(STEREO if stereo else {}), **(RING if ring else {})})
    if stereo:
        write_stereo(folder)
    if ring:
        write_ring(folder)
    if sweeps:
        points = {"x": [1.5, -2.0], "y": [0.25, 3.0], "z": [0.0, 1.0]}
        halves: dict[str, Any] = {axis: pa.array(np.array(each, np.float16)) for axis, each in points.items()}
        path = folder / "sensors" / "lidar" / f"{START_NS + STEP_NS}.feather"
        write_table(path, {**halves, "intensity": pa.array([3, 200], pa.uint8())})
    return folder
