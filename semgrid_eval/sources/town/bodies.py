"""What road users look like: a few tapered boxes for each shape, posed and coloured an actor."""

import csv
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import semgrid_eval
from semgrid_eval.geometry import Floats
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.solids import BOX, Texture, colours
from semgrid_eval.sources.town.traffic import ROAD_USERS, Shape, Snapshot

_COLOURS = ("main", "second", "dark", "glass", "skin", "red")
_OWN = 0  # the label of the actor itself
_CODES = {
    "label": {"own": _OWN, "rider": LABEL_ID["rider"]},
    "texture": {texture.name.lower(): int(texture) for texture in Texture},
    "colour": {name: index for index, name in enumerate(_COLOURS)},
}
_STRIDE_HZ = 1.7
_STRIDE_M = 0.22
_PAINT = np.array(colours("c8c8c6 1c1d20 787c82 3c424e 961e1c 20346e d7d5cd 525456 2e4e3e aa9678"), np.uint8)
_CLOTH = np.array(colours("3c466e 782828 282a2e 968c78 466450 beb9af aa7828 5f466e 1e3c5a cdbe3c"), np.uint8)
_FIXED_COLOURS = np.array([(0, 0, 0), (0, 0, 0), *colours("222326 2e363e c4987e 961614")], np.uint8)


@cache
def _parts() -> dict[Shape, Floats]:
    """Read the parts (P, 13) of every shape, words as their codes.

    Each has x, y of its base's centre; bottom, top; length and width of base and of top, and the top's shift, all as
    shares of the actor's length, width and height; label; texture; which of the actor's colours; and how it swings when
    the actor walks.
    """
    parts: dict[Shape, list[list[float]]] = {shape: [] for shape in Shape}
    with (Path(semgrid_eval.__file__).parent / "data" / "town_bodies.csv").open(newline="") as stream:
        for row in csv.DictReader(stream):
            shape = Shape[row.pop("shape").upper()]
            parts[shape].append([_CODES[name][word] if name in _CODES else float(word) for name, word in row.items()])
    return {shape: np.array(rows) for shape, rows in parts.items()}


def heights_m(actor: NDArray[np.int32], type_index: NDArray[np.uint8]) -> Floats:
    """Return the heights (A,) of actors: their type's, but people differ."""
    nominal = np.array([user.height_m for user in ROAD_USERS])[type_index]
    is_person = np.array([user.shape is Shape.PERSON for user in ROAD_USERS])[type_index]
    return np.where(is_person, nominal * (0.84 + 0.24 * _drawn(actor, 1)), nominal)


def actor_ids(actors: Snapshot) -> NDArray[np.int32]:
    """Return the ids (A,) of actors, which their pixels in the instance image have; 0 means no actor."""
    return actors.actor + 1


def boxes_of(snapshot: Snapshot, time_s: float) -> NDArray[np.void]:
    """Return the rows of `BOX` that make up the actors of a snapshot; the time moves the legs of those who walk."""
    shapes = np.array([user.shape for user in ROAD_USERS])[snapshot.type_index]
    there = [shape for shape in Shape if np.any(shapes == shape)]
    parts = [_posed(_parts()[shape], snapshot.where(shapes == shape), time_s) for shape in there]
    return np.concatenate(parts) if parts else np.empty(0, BOX)


def _posed(part: Floats, actors: Snapshot, time_s: float) -> NDArray[np.void]:
    """Pose parts (P, 13) for A actors of one shape: A * P rows."""
    users = [ROAD_USERS[index] for index in actors.type_index]
    length = np.array([user.length_m for user in users])[:, None]
    width = np.array([user.width_m for user in users])[:, None]
    height = heights_m(actors.actor, actors.type_index)[:, None]
    rows = np.zeros((len(actors), len(part)), BOX)
    ahead_m = part[..., 0] * length + _stride_m(actors, time_s)[:, None] * part[..., 12]
    left_m = part[..., 1] * width
    cos, sin = np.cos(actors.yaw_rad)[:, None], np.sin(actors.yaw_rad)[:, None]
    rows["x_m"] = actors.centre_m[:, :1] + cos * ahead_m - sin * left_m
    rows["y_m"] = actors.centre_m[:, 1:] + sin * ahead_m + cos * left_m
    rows["yaw_rad"] = actors.yaw_rad[:, None]
    scales = {"bottom_m": height, "top_m": height, "length_m": length, "width_m": width}
    scales |= {"top_length_m": length, "top_width_m": width, "top_shift_m": length}
    for column, (name, scale) in enumerate(scales.items(), start=2):
        rows[name] = part[..., column] * scale
    own = np.array([user.label_id for user in users])[:, None]
    rows["label"] = np.where(part[..., 9] == _OWN, own, part[..., 9])
    rows["texture"] = part[..., 10]
    rows["instance"] = actor_ids(actors)[:, None]
    rows["colour"] = _colours(actors)[:, part[:, 11].astype(int)]
    return rows.ravel()


def _stride_m(actors: Snapshot, time_s: float) -> Floats:
    """Return how far (A,) the left leg is ahead: nothing for those who stand."""
    speed = np.linalg.norm(actors.velocity_mps, axis=1)
    phase = 2.0 * np.pi * (_STRIDE_HZ * time_s + _drawn(actors.actor, 2))
    return np.asarray(_STRIDE_M * np.clip(speed / 1.3, 0.0, 1.0) * np.sin(phase))


def _colours(actors: Snapshot) -> NDArray[np.uint8]:
    """Return each actor's six colours (A, 6, 3)."""
    chosen = np.tile(_FIXED_COLOURS, (len(actors), 1, 1))
    chosen[:, 0] = _PAINT[(_drawn(actors.actor, 3) * len(_PAINT)).astype(int)]
    chosen[:, 1] = _CLOTH[(_drawn(actors.actor, 4) * len(_CLOTH)).astype(int)]
    return chosen


def _drawn(actor: NDArray[np.int32], purpose: int) -> Floats:
    """Return a number in 0..1 for each actor (A,) that is always the same for it: a multiplicative hash."""
    mixed = (actor.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(purpose * 0x85EBCA6B)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return (mixed >> np.uint64(40)).astype(np.float64) / (1 << 24)
