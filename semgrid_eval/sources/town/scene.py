"""A town's static scene: the ground, everything that stands on it, and the parked cars among it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.sources.town.bodies import boxes_of
from semgrid_eval.sources.town.frontage import Frontage, Plots
from semgrid_eval.sources.town.furniture import furnish_streets, park_cars
from semgrid_eval.sources.town.ground import Ground, GroundPainter, paint_streets
from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.network import Network
from semgrid_eval.sources.town.solids import BOX, Soup, soup_of_boxes
from semgrid_eval.sources.town.traffic import Snapshot
from semgrid_eval.sources.town.trees import soup_of_trees

FIRST_PARKED_ID = 32768
"""Actor ids from here on are parked cars; SUMO's road users have lower ones."""


@dataclass(frozen=True)
class Scene:
    """What does not move."""

    ground: Ground  # the flat ground at z = 0
    soup: Soup  # triangles of everything that stands on it, in the map frame
    parked: Snapshot  # the parked cars; their pixels' instance is `FIRST_PARKED_ID` + their index

    def save(self, folder: Path) -> None:
        """Write the scene's arrays."""
        self.ground.save(folder)
        self.soup.save(folder)
        still = self.parked
        np.savez(folder / "parked.npz", type_index=still.type_index, centre=still.centre_m, yaw=still.yaw_rad)

    @classmethod
    def load(cls, folder: Path) -> "Scene":
        """Map the scene's arrays from disk; only what is touched is read."""
        with np.load(folder / "parked.npz") as parked:
            still = _standing(parked["type_index"], parked["centre"], parked["yaw"])
        return cls(Ground.load(folder), Soup.load(folder), still)


def build_scene(network: Network, kind: TownKind, rng: np.random.Generator) -> Scene:
    """Build a town along its streets; the same generator state gives the same town."""
    painter = GroundPainter(network.bounds_m())
    paint_streets(network, painter)
    ground = painter.finished()
    cars = park_cars(network, kind, rng)
    places = np.array([car[1:] for car in cars], np.float64).reshape(-1, 3)
    parked = _standing(np.array([car[0] for car in cars], np.uint8), places[:, :2], places[:, 2])
    furniture, trees = furnish_streets(network, kind, rng)
    frontage = Frontage(kind, Plots(ground), rng)
    frontage.line_streets(network)
    boxes = np.concatenate([np.array(furniture + frontage.boxes, BOX), boxes_of(parked, 0.0)])
    return Scene(ground, Soup.joined([soup_of_boxes(boxes), soup_of_trees(trees + frontage.trees, rng)]), parked)


def _standing(type_index: NDArray[np.uint8], centre_m: NDArray[np.float64], yaw_rad: NDArray[np.float64]) -> Snapshot:
    # Parked cars get actor indices of their own so that they do not copy the colours of moving ones.
    actor = (FIRST_PARKED_ID - 1 + np.arange(len(type_index))).astype(np.int32)
    return Snapshot(actor, type_index, centre_m, yaw_rad, np.zeros((len(type_index), 2)))
