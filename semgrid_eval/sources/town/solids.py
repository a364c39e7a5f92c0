"""The solids that everything in the town is made of, tapered boxes, trees and bushes, turned into triangles."""

from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.geometry import Floats
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.columns import Columns

Texture = IntEnum("Texture", "PLAIN FACADE ROOF FOLIAGE GLASS PLANKS", start=0)
"""How a surface is shaded."""
_MEASURES = ("x_m", "y_m", "yaw_rad", "bottom_m", "top_m", "length_m", "width_m")
_OF_TOP = ("top_length_m", "top_width_m", "top_shift_m")
_LOOKS = [("label", "u1"), ("texture", "u1"), ("instance", "u2"), ("colour", "u1", (3,))]
BOX = np.dtype([*((name, "f8") for name in _MEASURES + _OF_TOP), *_LOOKS])
"""A tapered box: centre of its base in the map frame, direction of its length, and its top's shift along the length."""
Colour = tuple[int, int, int]
Look = tuple[int, int, Colour]
"""Cityscapes label id, texture and sRGB colour."""
BoxRow = tuple[float | Colour, ...]

# Corners: bit 0 front, bit 1 left, bit 2 top. Faces turn counter-clockwise seen from outside.
_FACES = "023 031 457 476 015 054 267 273 137 175 046 062"
_BOX_FACES = np.array([[int(corner) for corner in face] for face in _FACES.split()])
_VEGETATION = LABEL_ID["vegetation"]
_BARK = (88, 72, 58)
_LEAVES = np.array([(70, 98, 48), (88, 112, 54), (58, 84, 46), (104, 116, 60), (76, 92, 58)], np.uint8)


def colours(hexadecimal: str) -> list[Colour]:
    """Return sRGB colours that are written with six hexadecimal digits each."""
    return [(red, green, blue) for red, green, blue in map(bytes.fromhex, hexadecimal.split())]


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

    The place is x, y of the base's centre and yaw; heights are bottom and top, sizes length and width of the base and,
    where they differ, of the top; the instance is an actor's id, 0 where there is none.
    """
    label, texture, colour = look
    return (*place, *heights_m, *size_m, *(top_size_m or size_m), 0.0, label, texture, instance, colour)


@dataclass(frozen=True)
class Soup(Columns):
    """Triangles with what a camera can know of them: (F, 3, 3) corners and one value a triangle of all else."""

    triangles_m: NDArray[np.float32]
    label: NDArray[np.uint8]
    texture: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    colour: NDArray[np.uint8]  # (F, 3) sRGB

    def __len__(self) -> int:
        return len(self.label)

    def moved(self, x_m: float, y_m: float) -> "Soup":
        """Return the soup moved by x, y, computed in double precision."""
        offset_m = np.array([x_m, y_m, 0.0])
        return replace(self, triangles_m=(self.triangles_m.astype(np.float64) + offset_m).astype(np.float32))


def soup_of_boxes(boxes: NDArray[np.void]) -> Soup:
    """Turn rows of `BOX` (N,) into 12 N triangles."""
    front = np.where(np.arange(8) & 1, 0.5, -0.5)
    left = np.where(np.arange(8) & 2, 0.5, -0.5)
    is_top = (np.arange(8) & 4) > 0
    column = {name: boxes[name][:, None] for name in boxes.dtype.names or ()}
    ahead_m = front * np.where(is_top, column["top_length_m"], column["length_m"]) + is_top * column["top_shift_m"]
    left_m = left * np.where(is_top, column["top_width_m"], column["width_m"])
    cos, sin = np.cos(column["yaw_rad"]), np.sin(column["yaw_rad"])
    x_m, y_m = column["x_m"] + cos * ahead_m - sin * left_m, column["y_m"] + sin * ahead_m + cos * left_m
    corners = np.stack([x_m, y_m, np.where(is_top, column["top_m"], column["bottom_m"])], axis=-1)
    triangles = corners[:, _BOX_FACES].reshape(-1, 3, 3).astype(np.float32)
    return Soup(triangles, *(np.repeat(boxes[name], len(_BOX_FACES), axis=0) for name, *_ in _LOOKS))


def soup_of_crowns(
    centres_m: Floats, radii_m: Floats, label: int, colours: NDArray[np.uint8], rng: np.random.Generator
) -> Soup:
    """Turn N crowns into 80 N triangles: ellipsoids with a bumpy surface.

    Their centres (N, 3), radii (N, 2), horizontal and vertical, and sRGB colours (N, 3) differ.
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


def _icosphere() -> tuple[Floats, NDArray[np.int64]]:
    """Return the directions (42, 3) and faces (80, 3) of an icosahedron whose faces are split once."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([np.roll(corner, turn) for turn in range(3) for corner in corners])
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = distances < 2.1
    faces = [face for face in combinations(range(12), 3) if all(near[edge] for edge in combinations(face, 2))]
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


def _is_outward(points: Floats, face: tuple[int, int, int]) -> bool:
    first, second, third = points[list(face)]
    return bool(np.dot(np.cross(second - first, third - first), first) > 0.0)


@dataclass(frozen=True)
class Tree:
    """A tree or, without a trunk, a bush; its crown is an ellipsoid around `crown_m` above the ground."""

    x_m: float
    y_m: float
    crown_m: float
    radius_m: float
    half_height_m: float
    trunk_m: float  # diameter, 0 for a bush
    colour: int


def draw_tree(x_m: float, y_m: float, size: float, rng: np.random.Generator) -> Tree:
    """Draw a tree around the given relative size; its crown begins above people's heads."""
    scale = size * float(np.clip(rng.normal(1.0, 0.15), 0.6, 1.5))
    half_height_m = scale * float(rng.uniform(1.8, 3.0))
    bottom_m = float(rng.uniform(2.0, 3.2))
    radius_m = scale * float(rng.uniform(1.5, 2.6))
    colour = int(rng.integers(len(_LEAVES)))
    return Tree(x_m, y_m, bottom_m + half_height_m, radius_m, half_height_m, 0.22 + 0.16 * scale, colour)


def draw_bush(x_m: float, y_m: float, rng: np.random.Generator) -> Tree:
    """Draw a bush that stands on the ground."""
    radius_m = float(rng.uniform(0.5, 1.5))
    half_height_m = radius_m * float(rng.uniform(0.7, 1.1))
    return Tree(x_m, y_m, 0.8 * half_height_m, radius_m, half_height_m, 0.0, int(rng.integers(len(_LEAVES))))


def soup_of_trees(trees: list[Tree], rng: np.random.Generator) -> Soup:
    """Turn trees into triangles."""
    look = (_VEGETATION, Texture.PLAIN, _BARK)
    trunks = []
    for tree in trees:
        if tree.trunk_m > 0.0:
            place, thick, thin = (tree.x_m, tree.y_m, 0.4), tree.trunk_m, 0.6 * tree.trunk_m
            trunks.append(box(place, (0.0, tree.crown_m), (thick, thick), look, top_size_m=(thin, thin)))
    crowns = soup_of_crowns(
        np.array([(tree.x_m, tree.y_m, tree.crown_m) for tree in trees]).reshape(-1, 3),
        np.array([(tree.radius_m, tree.half_height_m) for tree in trees]).reshape(-1, 2),
        _VEGETATION,
        _LEAVES[[tree.colour for tree in trees]].reshape(-1, 3),
        rng,
    )
    return Soup.joined([soup_of_boxes(np.array(trunks, BOX)), crowns])
