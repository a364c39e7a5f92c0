"""What road users look like: a few tapered boxes for each shape, posed and coloured an actor."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import LABEL_ID
from semgrid_eval.sources.town.road_users import ROAD_USERS, Shape
from semgrid_eval.sources.town.solids import BOX, Texture
from semgrid_eval.sources.town.traffic import Snapshot

_MAIN, _SECOND, _DARK, _GLASS, _SKIN, _RED = range(6)
_OWN = 0  # the label of the actor itself
_RIDER = LABEL_ID["rider"]
_PLAIN, _GLASSY = Texture.PLAIN, Texture.GLASS
_STRIDE_HZ = 1.7
_STRIDE_M = 0.22

# Each part: x, y of its base's centre; bottom, top; length, width; length, width, shift of its top (all as shares of
# the actor's length, width and height); label; texture; which of the actor's colours; way of swinging when walking.
_Part = tuple[float, float, float, float, float, float, float, float, float, int, int, int, int]


def _wheels(x: float, top: float, length: float) -> list[_Part]:
    return [
        (sx * x, sy * 0.43, 0.0, top, length, 0.13, length, 0.13, 0.0, _OWN, _PLAIN, _DARK, 0)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]


_PARTS: dict[Shape, list[_Part]] = {
    Shape.CAR: [
        (0.0, 0, 0.14, 0.60, 1.0, 0.96, 0.96, 0.90, -0.01, _OWN, _PLAIN, _MAIN, 0),
        (-0.06, 0, 0.59, 0.96, 0.70, 0.88, 0.42, 0.72, -0.02, _OWN, _GLASSY, _GLASS, 0),
        (-0.08, 0, 0.955, 1.0, 0.43, 0.73, 0.40, 0.68, 0.0, _OWN, _PLAIN, _MAIN, 0),
        (-0.493, 0, 0.42, 0.52, 0.02, 0.88, 0.02, 0.88, 0.0, _OWN, _PLAIN, _RED, 0),
        *_wheels(0.31, 0.43, 0.145),
    ],
    Shape.VAN: [
        (0.0, 0, 0.12, 0.55, 1.0, 0.96, 0.99, 0.95, 0.0, _OWN, _PLAIN, _MAIN, 0),
        (-0.05, 0, 0.54, 1.0, 0.88, 0.94, 0.74, 0.84, -0.06, _OWN, _PLAIN, _MAIN, 0),
        (-0.02, 0, 0.58, 0.82, 0.87, 0.955, 0.80, 0.90, -0.04, _OWN, _GLASSY, _GLASS, 0),
        (-0.493, 0, 0.34, 0.52, 0.02, 0.9, 0.02, 0.9, 0.0, _OWN, _PLAIN, _RED, 0),
        *_wheels(0.32, 0.34, 0.135),
    ],
    Shape.TRUCK: [
        (0.0, 0, 0.14, 0.31, 0.96, 0.70, 0.96, 0.70, 0.0, _OWN, _PLAIN, _DARK, 0),
        (0.39, 0, 0.15, 0.55, 0.21, 0.94, 0.21, 0.94, 0.0, _OWN, _PLAIN, _MAIN, 0),
        (0.385, 0, 0.54, 0.86, 0.20, 0.92, 0.17, 0.88, -0.01, _OWN, _GLASSY, _GLASS, 0),
        (-0.11, 0, 0.30, 1.0, 0.77, 1.0, 0.77, 1.0, 0.0, _OWN, _PLAIN, _SECOND, 0),
        (-0.494, 0, 0.18, 0.26, 0.01, 0.9, 0.01, 0.9, 0.0, _OWN, _PLAIN, _RED, 0),
        *_wheels(0.30, 0.30, 0.12),
    ],
    Shape.BUS: [
        (0.0, 0, 0.10, 0.99, 0.995, 0.97, 0.985, 0.94, 0.0, _OWN, _PLAIN, _MAIN, 0),
        (0.0, 0, 0.44, 0.80, 1.0, 0.985, 0.998, 0.975, 0.0, _OWN, _GLASSY, _GLASS, 0),
        (0.0, 0, 0.985, 1.0, 0.80, 0.70, 0.78, 0.66, 0.0, _OWN, _PLAIN, _SECOND, 0),
        *_wheels(0.29, 0.31, 0.08),
    ],
    Shape.BICYCLE: [
        (0.30, 0, 0.0, 0.38, 0.36, 0.13, 0.36, 0.13, 0.0, _OWN, _PLAIN, _DARK, 0),
        (-0.30, 0, 0.0, 0.38, 0.36, 0.13, 0.36, 0.13, 0.0, _OWN, _PLAIN, _DARK, 0),
        (0.0, 0, 0.20, 0.50, 0.34, 0.16, 0.52, 0.16, 0.03, _OWN, _PLAIN, _MAIN, 0),
        (0.25, 0, 0.50, 0.59, 0.05, 1.0, 0.05, 1.0, -0.03, _OWN, _PLAIN, _DARK, 0),
        (0.04, 0.18, 0.16, 0.56, 0.13, 0.22, 0.15, 0.24, -0.10, _RIDER, _PLAIN, _DARK, 1),
        (0.04, -0.18, 0.16, 0.56, 0.13, 0.22, 0.15, 0.24, -0.10, _RIDER, _PLAIN, _DARK, -1),
        (-0.07, 0, 0.53, 0.86, 0.17, 0.66, 0.16, 0.80, 0.12, _RIDER, _PLAIN, _SECOND, 0),
        (0.08, 0, 0.86, 1.0, 0.12, 0.32, 0.11, 0.28, 0.0, _RIDER, _PLAIN, _SKIN, 0),
    ],
    Shape.PERSON: [
        (0.0, 0.21, 0.0, 0.49, 0.42, 0.32, 0.48, 0.38, 0.0, _OWN, _PLAIN, _DARK, 1),
        (0.0, -0.21, 0.0, 0.49, 0.42, 0.32, 0.48, 0.38, 0.0, _OWN, _PLAIN, _DARK, -1),
        (0.0, 0, 0.46, 0.83, 0.60, 0.78, 0.58, 0.92, 0.0, _OWN, _PLAIN, _SECOND, 0),
        (0.0, 0.52, 0.44, 0.81, 0.24, 0.20, 0.26, 0.22, 0.0, _OWN, _PLAIN, _SECOND, -1),
        (0.0, -0.52, 0.44, 0.81, 0.24, 0.20, 0.26, 0.22, 0.0, _OWN, _PLAIN, _SECOND, 1),
        (0.02, 0, 0.85, 1.0, 0.50, 0.36, 0.44, 0.32, 0.0, _OWN, _PLAIN, _SKIN, 0),
    ],
}
_PAINT = np.array(
    [
        (200, 200, 198),
        (28, 29, 32),
        (120, 124, 130),
        (60, 66, 78),
        (150, 30, 28),
        (32, 52, 110),
        (215, 213, 205),
        (82, 84, 86),
        (46, 78, 62),
        (170, 150, 120),
    ],
    np.uint8,
)
_CLOTH = np.array(
    [
        (60, 70, 110),
        (120, 40, 40),
        (40, 42, 46),
        (150, 140, 120),
        (70, 100, 80),
        (190, 185, 175),
        (170, 120, 40),
        (95, 70, 110),
        (30, 60, 90),
        (205, 190, 60),
    ],
    np.uint8,
)
_FIXED_COLOURS = {_DARK: (34, 35, 38), _GLASS: (46, 54, 62), _SKIN: (196, 152, 126), _RED: (150, 22, 20)}


def heights_m(actor: NDArray[np.int32], type_index: NDArray[np.uint8]) -> NDArray[np.float64]:
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
    parts = [
        _posed(_PARTS[shape], snapshot.where(shapes == shape), time_s) for shape in Shape if np.any(shapes == shape)
    ]
    return np.concatenate(parts) if parts else np.empty(0, BOX)


def _posed(parts: list[_Part], actors: Snapshot, time_s: float) -> NDArray[np.void]:
    """Pose P parts for A actors of one shape: A * P rows."""
    part = np.array(parts)[None]  # (1, P, 13)
    users = [ROAD_USERS[index] for index in actors.type_index]
    length = np.array([user.length_m for user in users])[:, None]
    width = np.array([user.width_m for user in users])[:, None]
    height = heights_m(actors.actor, actors.type_index)[:, None]
    rows = np.zeros((len(actors), len(parts)), BOX)
    ahead_m = part[..., 0] * length + _stride_m(actors, time_s)[:, None] * part[..., 12]
    left_m = part[..., 1] * width
    cos, sin = np.cos(actors.yaw_rad)[:, None], np.sin(actors.yaw_rad)[:, None]
    rows["x_m"] = actors.centre_m[:, :1] + cos * ahead_m - sin * left_m
    rows["y_m"] = actors.centre_m[:, 1:] + sin * ahead_m + cos * left_m
    rows["yaw_rad"] = actors.yaw_rad[:, None]
    for column, (name, scale) in enumerate(
        [
            ("bottom_m", height),
            ("top_m", height),
            ("length_m", length),
            ("width_m", width),
            ("top_length_m", length),
            ("top_width_m", width),
            ("top_shift_m", length),
        ],
        start=2,
    ):
        rows[name] = part[..., column] * scale
    own = np.array([user.label_id for user in users])[:, None]
    rows["label"] = np.where(part[..., 9] == _OWN, own, part[..., 9])
    rows["texture"] = part[..., 10]
    rows["instance"] = actor_ids(actors)[:, None]
    rows["colour"] = _colours(actors)[:, part[0, :, 11].astype(int)]
    return rows.ravel()


def _stride_m(actors: Snapshot, time_s: float) -> NDArray[np.float64]:
    """Return how far (A,) the left leg is ahead: nothing for those who stand."""
    speed = np.linalg.norm(actors.velocity_mps, axis=1)
    phase = 2.0 * np.pi * (_STRIDE_HZ * time_s + _drawn(actors.actor, 2))
    return np.asarray(_STRIDE_M * np.clip(speed / 1.3, 0.0, 1.0) * np.sin(phase))


def _colours(actors: Snapshot) -> NDArray[np.uint8]:
    """Return each actor's six colours (A, 6, 3)."""
    colours = np.zeros((len(actors), 6, 3), np.uint8)
    colours[:, _MAIN] = _PAINT[(_drawn(actors.actor, 3) * len(_PAINT)).astype(int)]
    colours[:, _SECOND] = _CLOTH[(_drawn(actors.actor, 4) * len(_CLOTH)).astype(int)]
    for index, colour in _FIXED_COLOURS.items():
        colours[:, index] = colour
    return colours


def _drawn(actor: NDArray[np.int32], purpose: int) -> NDArray[np.float64]:
    """Return a number in 0..1 for each actor (A,) that is always the same for it: a multiplicative hash."""
    mixed = (actor.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(purpose * 0x85EBCA6B)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return (mixed >> np.uint64(40)).astype(np.float64) / (1 << 24)
