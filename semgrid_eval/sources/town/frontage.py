"""What lines a street beyond its sidewalk: buildings, yards with hedges, walls and fences, and what lies behind."""

from dataclasses import dataclass

import cv2
import numpy as np

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.ground import CELL_M, Ground, Surface
from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.network import Lane, LaneUse, Network, Polyline
from semgrid_eval.sources.town.solids import BoxRow, Look, Texture, Tree, box, colours, draw_bush, draw_tree

_BUILDING, _WALL, _FENCE, _HEDGE = (LABEL_ID[name] for name in ("building", "wall", "fence", "vegetation"))
_FLOOR_M = 3.1
_FACADES = colours("b09e84 965c4a c4bcac 847e78 bca670 7a5246 a4968e cec6b6 8e866c 6c6e74")
_ROOFS = ((110, 62, 52), (74, 72, 74), (96, 84, 76), (60, 62, 68))
_TOLERANCE_M = 0.8  # by which houses of a bent row may overlap, and their facades touch the sidewalk
_OCCUPANCY_STEP = 2  # ground cells a cell of the map of what is taken
_OCCUPANCY_M = CELL_M * _OCCUPANCY_STEP


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


@dataclass(frozen=True)
class _Parcel:
    """A piece of a street's outer side: from where to where along the line, and where the sidewalk ends left of it."""

    line: Polyline
    start_m: float
    width_m: float
    edge_m: float

    @property
    def end_m(self) -> float:
        return self.start_m + self.width_m


class Frontage:
    """Puts up what lines the streets of a town; `boxes` and `trees` are what stands so far."""

    def __init__(self, kind: TownKind, plots: Plots, rng: np.random.Generator) -> None:
        self.boxes: list[BoxRow] = []
        self.trees: list[Tree] = []
        self._kind = kind
        self._plots = plots
        self._rng = rng

    def line_streets(self, network: Network) -> None:
        """Put parcels along the outer side of every sidewalk, building or open, and fill what lies behind."""
        for lane in network.lanes:
            if lane.use is LaneUse.SIDEWALK:
                self._line_sidewalk(lane)
        self._fill_behind(network)

    def _line_sidewalk(self, lane: Lane) -> None:
        line, kind = Polyline.through(lane.line_m), self._kind
        setback_m = self._between(*kind.setback_m)
        start_m = -6.0  # parcels reach round the corner
        while start_m < line.length_m + 4.0:
            parcel = _Parcel(line, start_m, self._between(*kind.parcel_m), -lane.width_m / 2.0)
            built = self._rng.random() < kind.frontage and self._build_house(parcel, setback_m)
            if setback_m > 2.0 or not built:
                self._close_front(parcel)
            if not built:
                self._plant(parcel)
            has_gap = self._rng.random() < 0.2 or kind.floors[0] == 1
            start_m = parcel.end_m + (self._between(2.0, 8.0) if has_gap else 0.15)

    def _build_house(self, parcel: _Parcel, setback_m: float) -> bool:
        """Put a house up and say whether there was room."""
        depth_m, width_m = self._between(9.0, 15.0), parcel.width_m
        front_m = parcel.edge_m - setback_m - float(self._rng.choice([0.0, 0.0, 0.4, 1.0]))
        place = parcel.line.at(parcel.start_m + width_m / 2.0, front_m - depth_m / 2.0)
        if not self._plots.take(*place, (width_m - 2.0 * _TOLERANCE_M, depth_m - 2.0 * _TOLERANCE_M)):
            return False
        floors = int(self._rng.integers(self._kind.floors[0], self._kind.floors[1] + 1))
        height_m = floors * _FLOOR_M + self._between(0.3, 1.6)
        facade = (_BUILDING, Texture.FACADE, _FACADES[int(self._rng.integers(len(_FACADES)))])
        roof = (_BUILDING, Texture.ROOF, _ROOFS[int(self._rng.integers(len(_ROOFS)))])
        self.boxes.append(box(place, (0.0, height_m), (width_m, depth_m), facade))
        ridge_m = height_m + self._between(1.5, 4.5)
        top = (width_m * float(self._rng.choice([0.6, 0.99])), depth_m * 0.15)
        eaves = (width_m + 0.1, depth_m + 0.7)
        self.boxes.append(box(place, (height_m - 0.02, ridge_m), eaves, roof, top_size_m=top))
        self._add_relief(parcel, front_m, height_m, facade)
        return True

    def _add_relief(self, parcel: _Parcel, front_m: float, height_m: float, look: Look) -> None:
        """Break a facade's plane: bays and balconies above the ground floor, a porch or steps below."""
        for _ in range(int(self._rng.integers(0, 4))):
            size_m = (self._between(0.5, 1.3), self._between(1.6, 3.2))[::-1]  # width along the street, then depth
            along_m = self._between(parcel.start_m + 2.0, parcel.end_m - 2.0)
            place = parcel.line.at(along_m, front_m + size_m[1] / 2.0 - 0.05)
            if height_m > 2.0 * _FLOOR_M and self._rng.random() < 0.75:
                heights_m = (_FLOOR_M + 0.2, self._between(_FLOOR_M + 2.0, height_m - 0.5))
                self.boxes.append(box(place, heights_m, size_m, look))
            elif front_m < -4.0:
                self.boxes.append(box(place, (0.0, self._between(0.4, 2.7)), size_m, look))

    def _close_front(self, parcel: _Parcel) -> None:
        """Close a parcel towards the sidewalk with a hedge, a wall or a fence, or leave it open; gates stay open."""
        drawn = self._rng.random()
        if drawn > self._kind.hedges + self._kind.fences:
            return
        line, start_m = parcel.line, max(parcel.start_m, 0.0)
        end_m = min(parcel.end_m - self._between(1.2, 3.5), line.length_m)
        thickness_m, height_m, look = self._draw_closure(is_hedge=drawn < self._kind.hedges)
        for along_m in np.arange(start_m, end_m, 5.0).tolist():
            length_m = min(5.0, end_m - along_m)
            place = line.at(along_m + length_m / 2.0, parcel.edge_m - 0.3 - thickness_m / 2.0)
            if length_m > 0.5 and self._plots.take(*place, (length_m - 0.4, thickness_m)):
                self.boxes.append(box(place, (0.0, height_m), (length_m, thickness_m), look))

    def _draw_closure(self, *, is_hedge: bool) -> tuple[float, float, Look]:
        """Draw thickness, height and look of a hedge, or of a wall or fence."""
        if is_hedge:
            return self._between(0.6, 1.2), self._between(0.8, 2.0), (_HEDGE, Texture.FOLIAGE, (66, 88, 46))
        if self._rng.random() < 0.5:
            return 0.3, self._between(0.7, 2.0), (_WALL, Texture.ROOF, (150, 138, 124))
        return 0.12, self._between(0.9, 1.8), (_FENCE, Texture.PLANKS, (120, 98, 74))

    def _plant(self, parcel: _Parcel) -> None:
        """Put trees and bushes on an open parcel."""
        for _ in range(int(self._rng.integers(1, 5))):
            along_m = parcel.start_m + self._between(0.0, parcel.width_m)
            place = parcel.line.at(along_m, parcel.edge_m - self._between(2.0, 14.0))
            if self._plots.take(*place, (1.5, 1.5)):
                is_tree = self._rng.random() < 0.6
                x_m, y_m, _ = place
                self.trees.append(draw_tree(x_m, y_m, 1.3, self._rng) if is_tree else draw_bush(x_m, y_m, self._rng))

    def _fill_behind(self, network: Network) -> None:
        """Scatter houses and trees over the blocks and around the town, so that no gap shows an empty plain."""
        west_m, south_m, east_m, north_m = network.bounds_m()
        area_ha = (east_m - west_m + 120.0) * (north_m - south_m + 120.0) / 1e4
        for _ in range(round(area_ha * 14)):
            x_m, y_m = self._between(west_m - 60, east_m + 60), self._between(south_m - 60, north_m + 60)
            yaw_rad = self._between(-np.pi, np.pi)
            size_m = (self._between(8.0, 18.0), self._between(7.0, 12.0))
            if self._rng.random() < 0.6 * self._kind.frontage:
                if self._plots.take(x_m, y_m, yaw_rad, (size_m[0] + 3.0, size_m[1] + 3.0)):
                    look = (_BUILDING, Texture.FACADE, _FACADES[int(self._rng.integers(len(_FACADES)))])
                    height_m = float(self._rng.integers(1, self._kind.floors[1] + 1)) * _FLOOR_M + 0.5
                    self.boxes.append(box((x_m, y_m, yaw_rad), (0.0, height_m), size_m, look))
            elif self._plots.take(x_m, y_m, 0.0, (2.0, 2.0)):
                self.trees.append(draw_tree(x_m, y_m, 1.5, self._rng))

    def _between(self, low: float, high: float) -> float:
        return float(self._rng.uniform(low, high))
