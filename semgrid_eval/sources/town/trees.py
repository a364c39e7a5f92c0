"""Trees and bushes: a tapered trunk and bumpy crowns."""

from dataclasses import dataclass

import numpy as np

from semgrid_eval.classes import LABEL_ID
from semgrid_eval.sources.town.solids import BOX, Soup, Texture, box, soup_of_boxes, soup_of_crowns

_VEGETATION = LABEL_ID["vegetation"]
_BARK = (88, 72, 58)
_LEAVES = np.array([(70, 98, 48), (88, 112, 54), (58, 84, 46), (104, 116, 60), (76, 92, 58)], np.uint8)


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
