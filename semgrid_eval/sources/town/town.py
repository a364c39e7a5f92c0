"""A simulated town: streets and traffic from SUMO, a scene built along the streets, kept on disk by digest."""

import importlib.metadata
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.files import atomic_folder, digest_value, read_json, write_json
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.network import read_network
from semgrid_eval.sources.town.scene import FIRST_PARKED_ID, Scene, build_scene
from semgrid_eval.sources.town.simulation import simulate_traffic
from semgrid_eval.sources.town.streets import lay_out_streets
from semgrid_eval.sources.town.traffic import Traffic

TOWN_VERSION = 2
"""Counts changes to how towns are built; a town of another version is built again."""
_SPEC_FILE = "town.json"


@dataclass(frozen=True)
class TownSpec:
    """Everything that determines a town."""

    index: int  # which town of a data set; it chooses the kind
    kind: str  # name of a `TownKind`
    seed: int  # of the data set
    size_m: float  # side of the square that the streets cover
    duration_s: float  # recorded time

    def digest(self) -> str:
        """Digest the specification and the versions of what builds the town.

        Raises:
            MissingExtraError: SUMO is not installed.
        """
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
    """Build a town, unless the cache holds it already, and return its folder.

    Raises:
        InputError: SUMO failed, or the cache cannot be written to.
        MissingExtraError: SUMO is not installed.
    """
    folder = cache / f"town-{spec.digest()}"
    if not _is_complete(folder, spec):
        with atomic_folder(folder) as partial:
            _build(spec, partial)
            write_json(partial / _SPEC_FILE, _description(spec))
    return folder


def load_town(folder: Path) -> Town:
    """Map a town's arrays from disk.

    Raises:
        InputError: the folder holds no complete town.
    """
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
