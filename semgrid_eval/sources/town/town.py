"""A simulated town: streets and traffic from SUMO, a still scene built along the streets, kept on disk by digest."""

import importlib.metadata
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.files import atomic_folder, digest_value, read_json, write_json
from semgrid_eval.sources.town.bodies import boxes_of
from semgrid_eval.sources.town.frontage import Frontage, Plots
from semgrid_eval.sources.town.furniture import furnish_streets, park_cars
from semgrid_eval.sources.town.ground import Ground, GroundPainter, paint_streets
from semgrid_eval.sources.town.kinds import KINDS, TownKind
from semgrid_eval.sources.town.network import Network, read_network
from semgrid_eval.sources.town.simulation import simulate_traffic
from semgrid_eval.sources.town.solids import BOX, Soup, soup_of_boxes, soup_of_trees
from semgrid_eval.sources.town.streets import lay_out_streets
from semgrid_eval.sources.town.traffic import Snapshot, Traffic

FIRST_PARKED_ID = 32768
"""Actor ids from here on are parked cars; SUMO's road users have lower ones."""
TOWN_VERSION = 2
"""Counts changes to how towns are built; a town of another version is built again."""
_SPEC_FILE = "town.json"


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


@dataclass(frozen=True)
class TownSpec:
    """Everything that determines a town."""

    index: int  # which town of a data set; it chooses the kind
    kind: str  # name of a `TownKind`
    seed: int  # of the data set
    size_m: float  # side of the square that the streets cover
    duration_s: float  # recorded time

    def digest(self) -> str:
        """Digest the specification and the versions of what builds the town."""
        try:
            sumo = importlib.metadata.version("eclipse-sumo")
        except importlib.metadata.PackageNotFoundError:
            raise MissingExtraError("synthetic", "eclipse-sumo") from None
        return digest_value({"town": asdict(self), "version": TOWN_VERSION, "sumo": sumo})


@dataclass(frozen=True)
class Town:
    """A town on disk: its still scene and its traffic."""

    scene: Scene
    traffic: Traffic


def prepare_town(spec: TownSpec, cache: Path) -> Path:
    """Build a town, unless the cache holds it already, and return its folder."""
    folder = cache / f"town-{spec.digest()}"
    if not _is_complete(folder, spec):
        with atomic_folder(folder) as partial:
            _build(spec, partial)
            write_json(partial / _SPEC_FILE, _description(spec))
    return folder


def load_town(folder: Path) -> Town:
    """Map a town's arrays from disk, from a folder that must hold a complete town."""
    try:
        return Town(Scene.load(folder / "scene"), Traffic.load(folder / "traffic"))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"holds no complete town: {error}", path=folder) from error


def _description(spec: TownSpec) -> dict[str, Any]:
    return {**asdict(spec), "version": TOWN_VERSION}


def _is_complete(folder: Path, spec: TownSpec) -> bool:
    """Return whether the folder holds this town; the description is written last."""
    try:
        return bool(read_json(folder / _SPEC_FILE) == _description(spec))
    except InputError:
        return False


def _build(spec: TownSpec, folder: Path) -> None:
    kind = next(kind for kind in KINDS if kind.name == spec.kind)
    streets_rng, traffic_rng, scene_rng = np.random.default_rng([spec.seed, spec.index]).spawn(3)
    with tempfile.TemporaryDirectory(prefix="semgrid-town-") as workshop:
        path = lay_out_streets(kind, spec.size_m, streets_rng, Path(workshop))
        network = read_network(path)
        traffic = simulate_traffic(path, kind, network.street_km(), spec.duration_s, traffic_rng)
    if len(traffic.actor_types) >= FIRST_PARKED_ID:
        message = f"{len(traffic.actor_types)} road users are more than the {FIRST_PARKED_ID} that have an id"
        raise InputError(f"{message}; ask for a smaller town or a shorter time")
    for name, part in (("traffic", traffic), ("scene", build_scene(network, kind, scene_rng))):
        (folder / name).mkdir()
        part.save(folder / name)
