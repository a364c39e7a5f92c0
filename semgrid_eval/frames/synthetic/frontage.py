"""What lines a street beyond its sidewalk: buildings, yards with hedges, walls and fences, and what lies behind."""

from dataclasses import dataclass

import cv2
import numpy as np

from semgrid_eval.classes import LABEL_ID
from semgrid_eval.frames.synthetic.ground import CELL_M, Ground, Surface
from semgrid_eval.frames.synthetic.kinds import TownKind
from semgrid_eval.frames.synthetic.network import Lane, LaneUse, Network
from semgrid_eval.frames.synthetic.polyline import Polyline
from semgrid_eval.frames.synthetic.solids import BoxRow, Texture, box
from semgrid_eval.frames.synthetic.trees import Tree, draw_bush, draw_tree

_BUILDING, _WALL, _FENCE, _HEDGE = (LABEL_ID[name] for name in ("building", "wall", "fence", "vegetation"))
_FLOOR_M = 3.1
_FACADES = [
    (176, 158, 132),
    (150, 92, 74),
    (196, 188, 172),
    (132, 126, 120),
    (188, 166, 112),
    (122, 82, 70),
    (164, 150, 142),
    (206, 198, 182),
    (142, 134, 108),
    (108, 110, 116),
]
_ROOFS = ((110, 62, 52), (74, 72, 74), (96, 84, 76), (60, 62, 68))
_TOLERANCE_M = 0.8  # by which houses of a bent row may overlap, and their facades touch the sidewalk
_OCCUPANCY_STEP = 2  # ground cells a cell of the map of what is taken
_OCCUPANCY_M = CELL_M * _OCCUPANCY_STEP


@dataclass
class Frontage:
    """What has been put up so far."""

    boxes: list[BoxRow]
    trees: list[Tree]


class Plots:
    """Knows which ground is taken, by streets or by what has been built."""

    def __init__(self, ground: Ground) -> None:
        coarse = ground.surface[::_OCCUPANCY_STEP, ::_OCCUPANCY_STEP]
        self._taken = (coarse != Surface.TERRAIN).astype(np.uint8)
        self._origin_m = np.array([ground.west_m, ground.south_m])

    def take(self, x_m: float, y_m: float, yaw_rad: float, size_m: tuple[float, float]) -> bool:
        """Take a rectangle (length, width) around x, y if all of it is free."""
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        half = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * np.array(size_m) / 2.0
        corners = half @ np.array([[cos, sin], [-sin, cos]]) + (x_m, y_m)
        cells = np.round((corners - self._origin_m) / _OCCUPANCY_M).astype(np.int32)
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        if np.any(low < 0) or np.any(high[::-1] > self._taken.shape):
            return False
        window = self._taken[low[1] : high[1], low[0] : high[0]]
        mask = np.zeros(window.shape, np.uint8)
        cv2.fillConvexPoly(mask, cells - low, 1)
        if np.any(window & mask):
            return False
        window |= mask
        return True


def line_streets(network: Network, kind: TownKind, plots: Plots, rng: np.random.Generator) -> Frontage:
    """Put parcels along the outer side of every sidewalk, building or open, and fill what lies behind."""
    frontage = Frontage([], [])
    for lane in network.lanes:
        if lane.use is LaneUse.SIDEWALK:
            _line_sidewalk(lane, kind, plots, rng, frontage)
    _fill_behind(network, kind, plots, rng, frontage)
    return frontage


def _line_sidewalk(lane: Lane, kind: TownKind, plots: Plots, rng: np.random.Generator, frontage: Frontage) -> None:
    line = Polyline.through(lane.line_m)
    setback_m = float(rng.uniform(*kind.setback_m))
    edge_m = -lane.width_m / 2.0  # left of the sidewalk's middle
    s_m = -6.0  # parcels reach round the corner
    while s_m < line.length_m + 4.0:
        width_m = float(rng.uniform(*kind.parcel_m))
        is_built = rng.random() < kind.frontage
        built = is_built and _build_house(line, s_m, width_m, edge_m - setback_m, kind, plots, rng, frontage)
        if setback_m > 2.0 or not built:
            _close_front(line, (s_m, s_m + width_m), edge_m - 0.3, kind, plots, rng, frontage)
        if not built:
            _plant(line, s_m, width_m, edge_m, plots, rng, frontage)
        s_m += width_m + (float(rng.uniform(2.0, 8.0)) if rng.random() < 0.2 or kind.floors[0] == 1 else 0.15)


def _build_house(
    line: Polyline,
    s_m: float,
    width_m: float,
    front_m: float,
    kind: TownKind,
    plots: Plots,
    rng: np.random.Generator,
    frontage: Frontage,
) -> bool:
    """Put a house up with its facade `front_m` left of the line (negative: right); say whether there was room."""
    depth_m = float(rng.uniform(9.0, 15.0))
    recess_m = float(rng.choice([0.0, 0.0, 0.4, 1.0]))
    x_m, y_m, yaw_rad = line.at(s_m + width_m / 2.0, front_m - recess_m - depth_m / 2.0)
    if not plots.take(x_m, y_m, yaw_rad, (width_m - 2.0 * _TOLERANCE_M, depth_m - 2.0 * _TOLERANCE_M)):
        return False
    floors = int(rng.integers(kind.floors[0], kind.floors[1] + 1))
    height_m = floors * _FLOOR_M + float(rng.uniform(0.3, 1.6))
    facade = (_BUILDING, Texture.FACADE, _FACADES[int(rng.integers(len(_FACADES)))])
    roof = (_BUILDING, Texture.ROOF, _ROOFS[int(rng.integers(len(_ROOFS)))])
    frontage.boxes.append(box((x_m, y_m, yaw_rad), (0.0, height_m), (width_m, depth_m), facade))
    ridge_m = float(rng.uniform(1.5, 4.5))
    top = (width_m * float(rng.choice([0.6, 0.99])), depth_m * 0.15)
    eaves = (width_m + 0.1, depth_m + 0.7)
    frontage.boxes.append(box((x_m, y_m, yaw_rad), (height_m - 0.02, height_m + ridge_m), eaves, roof, top_size_m=top))
    _add_relief(line, (s_m, s_m + width_m), front_m - recess_m, height_m, facade, rng, frontage)
    return True


def _add_relief(
    line: Polyline,
    span_m: tuple[float, float],
    front_m: float,
    height_m: float,
    look: tuple[int, int, tuple[int, int, int]],
    rng: np.random.Generator,
    frontage: Frontage,
) -> None:
    """Break a facade's plane: bays and balconies above the ground floor, a porch or steps below."""
    for _ in range(int(rng.integers(0, 4))):
        depth_m, width_m = float(rng.uniform(0.5, 1.3)), float(rng.uniform(1.6, 3.2))
        s_m = float(rng.uniform(span_m[0] + 2.0, span_m[1] - 2.0))
        place = line.at(s_m, front_m + depth_m / 2.0 - 0.05)
        if height_m > 2.0 * _FLOOR_M and rng.random() < 0.75:
            top_m = float(rng.uniform(_FLOOR_M + 2.0, height_m - 0.5))
            frontage.boxes.append(box(place, (_FLOOR_M + 0.2, top_m), (width_m, depth_m), look))
        elif front_m < -4.0:
            frontage.boxes.append(box(place, (0.0, float(rng.uniform(0.4, 2.7))), (width_m, depth_m), look))


def _close_front(
    line: Polyline,
    span_m: tuple[float, float],
    left_m: float,
    kind: TownKind,
    plots: Plots,
    rng: np.random.Generator,
    frontage: Frontage,
) -> None:
    """Close a parcel towards the sidewalk with a hedge, a wall or a fence, or leave it open; gates stay open."""
    drawn = rng.random()
    if drawn > kind.hedges + kind.fences:
        return
    start_m, end_m = max(span_m[0], 0.0), min(span_m[1] - float(rng.uniform(1.2, 3.5)), line.length_m)
    if drawn < kind.hedges:
        thickness_m, height_m, look = (
            float(rng.uniform(0.6, 1.2)),
            float(rng.uniform(0.8, 2.0)),
            (_HEDGE, Texture.FOLIAGE, (66, 88, 46)),
        )
    elif rng.random() < 0.5:
        thickness_m, height_m, look = 0.3, float(rng.uniform(0.7, 2.0)), (_WALL, Texture.ROOF, (150, 138, 124))
    else:
        thickness_m, height_m, look = 0.12, float(rng.uniform(0.9, 1.8)), (_FENCE, Texture.PLANKS, (120, 98, 74))
    for s_m in np.arange(start_m, end_m, 5.0):
        length_m = min(5.0, end_m - float(s_m))
        x_m, y_m, yaw_rad = line.at(float(s_m) + length_m / 2.0, left_m - thickness_m / 2.0)
        if length_m > 0.5 and plots.take(x_m, y_m, yaw_rad, (length_m - 0.4, thickness_m)):
            frontage.boxes.append(box((x_m, y_m, yaw_rad), (0.0, height_m), (length_m, thickness_m), look))


def _plant(
    line: Polyline,
    s_m: float,
    width_m: float,
    edge_m: float,
    plots: Plots,
    rng: np.random.Generator,
    frontage: Frontage,
) -> None:
    """Put trees and bushes on an open parcel."""
    for _ in range(int(rng.integers(1, 5))):
        place = line.at(s_m + float(rng.uniform(0.0, width_m)), edge_m - float(rng.uniform(2.0, 14.0)))
        if plots.take(*place, (1.5, 1.5)):
            is_tree = rng.random() < 0.6
            tree = draw_tree(place[0], place[1], 1.3, rng) if is_tree else draw_bush(place[0], place[1], rng)
            frontage.trees.append(tree)


def _fill_behind(network: Network, kind: TownKind, plots: Plots, rng: np.random.Generator, frontage: Frontage) -> None:
    """Scatter houses and trees over the blocks and around the town, so that no gap shows an empty plain."""
    west_m, south_m, east_m, north_m = network.bounds_m()
    area_ha = (east_m - west_m + 120.0) * (north_m - south_m + 120.0) / 1e4
    for _ in range(round(area_ha * 14)):
        x_m, y_m = float(rng.uniform(west_m - 60, east_m + 60)), float(rng.uniform(south_m - 60, north_m + 60))
        yaw_rad = float(rng.uniform(-np.pi, np.pi))
        size_m = (float(rng.uniform(8.0, 18.0)), float(rng.uniform(7.0, 12.0)))
        if rng.random() < 0.6 * kind.frontage:
            clear_m = (size_m[0] + 3.0, size_m[1] + 3.0)
            if plots.take(x_m, y_m, yaw_rad, clear_m):
                look = (_BUILDING, Texture.FACADE, _FACADES[int(rng.integers(len(_FACADES)))])
                height_m = float(rng.integers(1, kind.floors[1] + 1)) * _FLOOR_M + 0.5
                frontage.boxes.append(box((x_m, y_m, yaw_rad), (0.0, height_m), size_m, look))
        elif plots.take(x_m, y_m, 0.0, (2.0, 2.0)):
            frontage.trees.append(draw_tree(x_m, y_m, 1.5, rng))
