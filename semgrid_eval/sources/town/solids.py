"""The two solids that everything in the town is made of, tapered boxes and tree crowns, turned into triangles."""

from dataclasses import dataclass, fields, replace
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


class Texture(IntEnum):
    """How a surface is shaded."""

    PLAIN = 0
    FACADE = 1
    ROOF = 2
    FOLIAGE = 3
    GLASS = 4
    PLANKS = 5


BOX = np.dtype(
    [
        ("x_m", "f8"),  # centre of the base in the map frame
        ("y_m", "f8"),
        ("yaw_rad", "f8"),  # direction of the length
        ("bottom_m", "f8"),
        ("top_m", "f8"),
        ("length_m", "f8"),
        ("width_m", "f8"),
        ("top_length_m", "f8"),
        ("top_width_m", "f8"),
        ("top_shift_m", "f8"),  # of the top against the base, along the length
        ("label", "u1"),
        ("texture", "u1"),
        ("instance", "u2"),
        ("colour", "u1", (3,)),
    ]
)
Look = tuple[int, int, tuple[int, int, int]]
"""Cityscapes label id, texture and sRGB colour."""
BoxRow = tuple[
    float, float, float, float, float, float, float, float, float, float, int, int, int, tuple[int, int, int]
]

# Corners: bit 0 front, bit 1 left, bit 2 top. Faces turn counter-clockwise seen from outside.
_BOX_FACES = np.array(
    [
        (0, 2, 3),
        (0, 3, 1),
        (4, 5, 7),
        (4, 7, 6),
        (0, 1, 5),
        (0, 5, 4),
        (2, 6, 7),
        (2, 7, 3),
        (1, 3, 7),
        (1, 7, 5),
        (0, 4, 6),
        (0, 6, 2),
    ]
)


def box(
    place: tuple[float, float, float],
    heights_m: tuple[float, float],
    size_m: tuple[float, float],
    look: Look,
    *,
    top_size_m: tuple[float, float] | None = None,
    instance: int = 0,
) -> BoxRow:
    """Return a row of `BOX`.

    Args:
        place: x, y of the base's centre and yaw.
        heights_m: bottom and top.
        size_m: length and width of the base.
        look: Cityscapes label id, texture and sRGB colour.
        top_size_m: length and width of the top where they differ.
        instance: actor id, 0 where there is none.
    """
    top = size_m if top_size_m is None else top_size_m
    return (*place, *heights_m, *size_m, *top, 0.0, look[0], look[1], instance, look[2])


@dataclass(frozen=True)
class Soup:
    """Triangles with what a camera can know of them: (F, 3, 3) corners and one value a triangle of all else."""

    triangles_m: NDArray[np.float32]
    label: NDArray[np.uint8]
    texture: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    colour: NDArray[np.uint8]  # (F, 3) sRGB

    def __len__(self) -> int:
        return len(self.label)

    def where(self, keep: NDArray[np.bool_]) -> "Soup":
        """Return the triangles for which `keep` (F,) holds."""
        return Soup(*(getattr(self, entry.name)[keep] for entry in fields(self)))

    def moved(self, x_m: float, y_m: float) -> "Soup":
        """Return the soup moved by x, y, computed in double precision."""
        offset_m = np.array([x_m, y_m, 0.0])
        return replace(self, triangles_m=(self.triangles_m.astype(np.float64) + offset_m).astype(np.float32))

    @staticmethod
    def joined(parts: list["Soup"]) -> "Soup":
        """Return all triangles of several soups, in order."""
        return Soup(*(np.concatenate([getattr(part, entry.name) for part in parts]) for entry in fields(Soup)))

    def save(self, folder: Path) -> None:
        """Write one `.npy` file an array."""
        for entry in fields(self):
            np.save(folder / f"{entry.name}.npy", getattr(self, entry.name))

    @classmethod
    def load(cls, folder: Path) -> "Soup":
        """Map the arrays from disk; only what is touched is read."""
        return cls(*(np.load(folder / f"{entry.name}.npy", mmap_mode="r") for entry in fields(cls)))


def soup_of_boxes(boxes: NDArray[np.void]) -> Soup:
    """Turn rows of `BOX` (N,) into 12 N triangles."""
    front = np.where(np.arange(8) & 1, 0.5, -0.5)
    left = np.where(np.arange(8) & 2, 0.5, -0.5)
    is_top = (np.arange(8) & 4) > 0
    column = {name: boxes[name][:, None] for name in boxes.dtype.names or ()}
    ahead_m = front * np.where(is_top, column["top_length_m"], column["length_m"]) + is_top * column["top_shift_m"]
    left_m = left * np.where(is_top, column["top_width_m"], column["width_m"])
    cos, sin = np.cos(column["yaw_rad"]), np.sin(column["yaw_rad"])
    corners = np.stack(
        [
            column["x_m"] + cos * ahead_m - sin * left_m,
            column["y_m"] + sin * ahead_m + cos * left_m,
            np.where(is_top, column["top_m"], column["bottom_m"]),
        ],
        axis=-1,
    )
    triangles = corners[:, _BOX_FACES].reshape(-1, 3, 3).astype(np.float32)
    attributes = (
        np.repeat(boxes[name], len(_BOX_FACES), axis=0) for name in ("label", "texture", "instance", "colour")
    )
    return Soup(triangles, *attributes)


def soup_of_crowns(
    centres_m: NDArray[np.float64],
    radii_m: NDArray[np.float64],
    label: int,
    colours: NDArray[np.uint8],
    rng: np.random.Generator,
) -> Soup:
    """Turn N crowns into 80 N triangles: ellipsoids with a bumpy surface.

    Args:
        centres_m: (N, 3).
        radii_m: (N, 2) horizontal and vertical.
        label: Cityscapes label id.
        colours: (N, 3) sRGB.
        rng: draws the bumps.
    """
    directions, faces = _icosphere()
    bumps = 1.0 + rng.uniform(-0.28, 0.12, (len(centres_m), len(directions), 1))
    corners = centres_m[:, None] + directions * bumps * radii_m[:, None, [0, 0, 1]]
    triangles = corners[:, faces].reshape(-1, 3, 3).astype(np.float32)
    count = len(triangles)
    return Soup(
        triangles,
        np.full(count, label, np.uint8),
        np.full(count, Texture.FOLIAGE, np.uint8),
        np.zeros(count, np.uint16),
        np.repeat(colours, len(faces), axis=0).astype(np.uint8),
    )


def _icosphere() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the directions (42, 3) and faces (80, 3) of an icosahedron whose faces are split once."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners])
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = distances < 2.1
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] & near[b, c] & near[a, c]
    ]
    corners_of = [tuple(face) if _is_outward(points, face) else (face[0], face[2], face[1]) for face in faces]
    places = list(points)
    middle: dict[frozenset[int], int] = {}
    for a, b, c in corners_of:
        for edge in ((a, b), (b, c), (c, a)):
            if frozenset(edge) not in middle:
                middle[frozenset(edge)] = len(places)
                places.append((points[edge[0]] + points[edge[1]]) / 2.0)
    split = []
    for a, b, c in corners_of:
        ab, bc, ca = middle[frozenset((a, b))], middle[frozenset((b, c))], middle[frozenset((c, a))]
        split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    directions = np.array(places)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True), np.array(split)


def _is_outward(points: NDArray[np.float64], face: tuple[int, int, int]) -> bool:
    first, second, third = points[list(face)]
    return bool(np.dot(np.cross(second - first, third - first), first) > 0.0)
