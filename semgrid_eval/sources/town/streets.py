"""Lays out a town's streets: SUMO's grid of junctions, displaced, thinned and bent, with lanes for every road user."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgrid_eval.geometry import Floats
from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.simulation import run_binary

SIDEWALK_WIDTH_M = 4.6  # narrower ones do not survive an opening of four cells of .78 m
PARKING_WIDTH_M = 2.2
BICYCLE_LANE_WIDTH_M = 1.7
CAR_LANE_WIDTH_M = 3.3
SPEED_LIMIT_MPS = 13.6
JUNCTION_RADIUS_M = 8.0
_BEND_POINTS = 7
_NETWORK = "town.net.xml"
Places = dict[str, Floats]
"""Of junctions (2,), by name."""


@dataclass(frozen=True)
class _Street:
    """A street between two junctions; both directions share its cross-section and its centre line."""

    lane_count: int
    has_bicycle_lane: bool
    has_parking: bool
    bend_m: float


def lay_out_streets(kind: TownKind, size_m: float, rng: np.random.Generator, folder: Path) -> Path:
    """Write a SUMO network of about `size_m` x `size_m` into `folder` and return its path."""
    count = max(3, round(size_m / kind.block_m) + 1)
    spacing_m = size_m / (count - 1)
    seed = str(int(rng.integers(1 << 30)))
    grid = ["--grid", "--grid.number", str(count), "--grid.length", f"{spacing_m:.2f}"]
    run_binary("netgenerate", [*grid, "--seed", seed, "--plain-output-prefix", "grid"], folder)
    limit_m = 0.22 * kind.block_m
    positions: Places = {}
    for node in ET.parse(folder / "grid.nod.xml").getroot().iter("node"):
        at = np.array([float(node.attrib["x"]), float(node.attrib["y"])])
        positions[node.attrib["id"]] = at + np.clip(rng.normal(0.0, kind.jitter_m, 2), -limit_m, limit_m)
    _write_nodes(folder / "town.nod.xml", positions, kind, rng)
    _write_edges(folder / "town.edg.xml", folder / "grid.edg.xml", positions, kind, rng)
    options = ["-n", "town.nod.xml", "-e", "town.edg.xml", "-o", _NETWORK, "--seed", seed]
    options += ["--crossings.guess", "--no-turnarounds", "--tls.discard-simple", "--keep-edges.components", "1"]
    options += ["--junctions.corner-detail", "8", "--offset.disable-normalization"]
    run_binary("netconvert", options, folder)
    return folder / _NETWORK


def _write_nodes(path: Path, positions: Places, kind: TownKind, rng: np.random.Generator) -> None:
    root = ET.Element("nodes")
    for name, (x_m, y_m) in positions.items():
        control = "traffic_light" if rng.random() < kind.traffic_lights else "priority"
        place = {"x": f"{x_m:.2f}", "y": f"{y_m:.2f}"}
        ET.SubElement(root, "node", {"id": name, "type": control, "radius": str(JUNCTION_RADIUS_M), **place})
    ET.ElementTree(root).write(path)


def _write_edges(path: Path, grid: Path, positions: Places, kind: TownKind, rng: np.random.Generator) -> None:
    root = ET.Element("edges")
    streets: dict[tuple[str, str], _Street | None] = {}
    for edge in ET.parse(grid).getroot().iter("edge"):
        start, end = edge.attrib["from"], edge.attrib["to"]
        key = (min(start, end), max(start, end))
        if key not in streets:
            length_m = float(np.linalg.norm(positions[key[1]] - positions[key[0]]))
            streets[key] = _draw_street(kind, length_m, rng)
        street = streets[key]
        if street is not None:
            line = _bent_line(positions[key[0]], positions[key[1]], street.bend_m)
            _add_edge(root, edge.attrib["id"], (start, end), street, line if start == key[0] else line[::-1])
    ET.ElementTree(root).write(path)


def _draw_street(kind: TownKind, length_m: float, rng: np.random.Generator) -> _Street | None:
    """Draw a street's cross-section, or None for one that is left out (the draws are the same either way)."""
    dropped, lanes, bicycle, parking, bent = rng.random(5)
    bend_m = float(rng.uniform(0.03, 0.10) * rng.choice([-1.0, 1.0]) * length_m)
    if dropped < kind.dropped_streets:
        return None
    return _Street(
        lane_count=2 if lanes < kind.two_lanes else 1,
        has_bicycle_lane=bool(bicycle < kind.bicycle_lanes),
        has_parking=bool(parking < kind.parking_strips),
        bend_m=bend_m if bent < kind.bent_streets else 0.0,
    )


def _bent_line(start: Floats, end: Floats, bend_m: float) -> Floats:
    """Return the centre line (N, 2): a parabola whose middle lies `bend_m` left of the straight line."""
    along = np.linspace(0.0, 1.0, _BEND_POINTS if bend_m else 2)[:, None]
    direction = (end - start) / np.linalg.norm(end - start)
    left = np.array([-direction[1], direction[0]])
    return np.asarray(start + along * (end - start) + 4.0 * along * (1.0 - along) * bend_m * left)


def _add_edge(root: ET.Element, name: str, ends: tuple[str, str], street: _Street, line: Floats) -> None:
    lanes: list[dict[str, str]] = [{"allow": "pedestrian", "width": str(SIDEWALK_WIDTH_M)}]
    if street.has_parking:
        lanes.append({"disallow": "all", "width": str(PARKING_WIDTH_M)})
    if street.has_bicycle_lane:
        lanes.append({"allow": "bicycle", "width": str(BICYCLE_LANE_WIDTH_M)})
    lanes += [{"disallow": "pedestrian", "width": str(CAR_LANE_WIDTH_M)}] * street.lane_count
    shape = " ".join(f"{x_m:.2f},{y_m:.2f}" for x_m, y_m in line)
    extent = {"from": ends[0], "to": ends[1], "shape": shape, "numLanes": str(len(lanes))}
    edge = ET.SubElement(root, "edge", {"id": name, "speed": str(SPEED_LIMIT_MPS), "priority": "5", **extent})
    for index, lane in enumerate(lanes):
        ET.SubElement(edge, "lane", {"index": str(index), **lane})
