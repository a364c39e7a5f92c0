"""The flat ground of a town as a raster of surfaces: road, markings, sidewalk, terrain."""

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.geometry import Floats
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.sources.town.network import Lane, LaneUse, Network, Polyline

CELL_M = 0.2
MARGIN_M = 120.0
_SHIFT_BITS = 4
_DASH_M, _GAP_M = 3.0, 5.0
_STRIPE_M, _STRIPE_PERIOD_M = 0.4, 1.2
Surface = IntEnum("Surface", "TERRAIN ROAD MARKING SIDEWALK CROSSING BICYCLE_LANE PARKING", start=0)
"""What the ground is made of."""
_LOOKS = {
    Surface.TERRAIN: ("terrain", (92, 108, 62)),
    Surface.ROAD: ("road", (92, 92, 94)),
    Surface.MARKING: ("road", (205, 205, 200)),
    Surface.SIDEWALK: ("sidewalk", (146, 140, 134)),
    Surface.CROSSING: ("road", (200, 200, 196)),
    Surface.BICYCLE_LANE: ("road", (112, 78, 72)),
    Surface.PARKING: ("road", (104, 102, 102)),
}
_LANE_SURFACES = {  # in the order of drawing
    LaneUse.PARKING: Surface.PARKING,
    LaneUse.BICYCLE: Surface.BICYCLE_LANE,
    LaneUse.CAR: Surface.ROAD,
    LaneUse.SIDEWALK: Surface.SIDEWALK,
}
SURFACE_LABELS = np.array([LABEL_ID[_LOOKS[surface][0]] for surface in Surface], np.uint8)
SURFACE_COLOURS = np.array([_LOOKS[surface][1] for surface in Surface], np.uint8)


@dataclass(frozen=True)
class Ground:
    """Surfaces (H, W) of cells of `CELL_M`; row 0 is southernmost, column 0 westernmost, beyond them is terrain."""

    surface: NDArray[np.uint8]  # values of `Surface`
    west_m: float  # x of the western edge in the map frame
    south_m: float  # y of the southern edge in the map frame

    def at(self, x_m: NDArray[np.floating], y_m: NDArray[np.floating]) -> NDArray[np.uint8]:
        """Return the surfaces at points of any shape in the map frame."""
        height, width = self.surface.shape
        column = np.floor((x_m - self.west_m) * (1.0 / CELL_M)).astype(np.int32)
        row = np.floor((y_m - self.south_m) * (1.0 / CELL_M)).astype(np.int32)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        index = np.where(inside, row * width + column, 0)
        found = np.take(self.surface.reshape(-1), index)
        return np.where(inside, found, np.uint8(Surface.TERRAIN))

    def save(self, folder: Path) -> None:
        """Write the raster and its place."""
        np.save(folder / "surface.npy", self.surface)
        np.save(folder / "place.npy", np.array([self.west_m, self.south_m]))

    @classmethod
    def load(cls, folder: Path) -> "Ground":
        """Map the raster from disk; only what is touched is read."""
        west_m, south_m = np.load(folder / "place.npy")
        return cls(np.load(folder / "surface.npy", mmap_mode="r"), float(west_m), float(south_m))


class GroundPainter:
    """Draws polygons and lines of the map frame into the raster of surfaces."""

    def __init__(self, bounds_m: tuple[float, float, float, float]) -> None:
        west_m, south_m, east_m, north_m = bounds_m
        self._west_m, self._south_m = west_m - MARGIN_M, south_m - MARGIN_M
        width = int((east_m + MARGIN_M - self._west_m) / CELL_M)
        height = int((north_m + MARGIN_M - self._south_m) / CELL_M)
        self._surface = np.full((height, width), Surface.TERRAIN, np.uint8)

    def polygon(self, points_m: Floats, surface: Surface) -> None:
        """Fill a polygon (N, 2)."""
        cv2.fillPoly(self._surface, [self._fixed_point(points_m)], int(surface), cv2.LINE_8, _SHIFT_BITS)

    def line(self, points_m: Floats, width_m: float, surface: Surface) -> None:
        """Draw a line (N, 2) of some width; like all shapes it covers every cell that it touches."""
        for start, end in pairwise(points_m):
            length = np.linalg.norm(end - start)
            if length > 0.0:
                ahead = (end - start) / length
                side = np.array([-ahead[1], ahead[0]]) * width_m / 2.0
                self.polygon(np.array([start + side, end + side, end - side, start - side]), surface)

    def finished(self) -> Ground:
        """Return the ground as drawn so far."""
        return Ground(self._surface, self._west_m, self._south_m)

    def _fixed_point(self, points_m: Floats) -> NDArray[np.int32]:
        """Return points in cells, where whole numbers are cell centres, as OpenCV's fixed-point numbers."""
        cells = (points_m - (self._west_m, self._south_m)) / CELL_M - 0.5
        return np.round(cells * (1 << _SHIFT_BITS)).astype(np.int32)


def paint_streets(network: Network, painter: GroundPainter) -> None:
    """Draw all streets of a town: junctions, lanes, markings, sidewalks, crossings, in this order."""
    for shape_m in network.junctions_m:
        painter.polygon(shape_m, Surface.ROAD)
    for use, surface in _LANE_SURFACES.items():
        lanes = [lane for lane in network.lanes if lane.use is use]
        for lane in lanes:
            painter.line(lane.line_m, lane.width_m, surface)
        for lane in lanes if use is LaneUse.CAR else ():
            _paint_markings(lane, painter)
    for shape_m in network.walking_areas_m:
        painter.polygon(shape_m, Surface.SIDEWALK)
    for line_m, width_m in network.crossings:
        _paint_crossing(line_m, width_m, painter)


def _paint_markings(lane: Lane, painter: GroundPainter) -> None:
    """Draw the dashes left of a lane and the line where it stops."""
    line = Polyline.through(lane.line_m)
    for start_m in np.arange(1.0, line.length_m - _DASH_M, _DASH_M + _GAP_M):
        painter.line(line.piece(start_m, start_m + _DASH_M, lane.width_m / 2.0), 0.1, Surface.MARKING)
    if lane.ends_at_light:
        stop_m = line.length_m - 0.4
        ends = [line.at(stop_m, side * lane.width_m / 2.0)[:2] for side in (-1.0, 1.0)]
        painter.line(np.array(ends), 0.3, Surface.MARKING)


def _paint_crossing(line_m: Floats, width_m: float, painter: GroundPainter) -> None:
    """Draw the stripes of a crossing over the road that it crosses."""
    line = Polyline.through(line_m)
    for start_m in np.arange(0.3, line.length_m - _STRIPE_M, _STRIPE_PERIOD_M):
        painter.line(line.piece(start_m, start_m + _STRIPE_M), width_m - 1.0, Surface.CROSSING)
