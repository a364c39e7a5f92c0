"""Simulates a town's traffic with SUMO and turns its trajectories into compact arrays."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from semgrid_eval.errors import InputError
from semgrid_eval.frames.synthetic.kinds import TownKind
from semgrid_eval.frames.synthetic.road_users import ROAD_USERS, type_index
from semgrid_eval.frames.synthetic.sumo import run_binary, run_tool
from semgrid_eval.frames.synthetic.traffic import Traffic

STEP_S = 0.059  # SUMO counts whole milliseconds; 1/17 s is 58.8 ms
WARM_UP_S = 60.0
_TRAJECTORIES = "fcd.csv"
_FIELDS = ["timestep_time", "vehicle_id", "vehicle_x", "vehicle_y", "vehicle_angle", "vehicle_speed", "vehicle_type"]


@dataclass(frozen=True)
class _Stream:
    """The trips of one SUMO class: so many at a time, each taking about `trip_s`."""

    sumo_class: str
    count: int
    trip_s: float
    options: tuple[str, ...]


def simulate_traffic(
    network: Path, kind: TownKind, street_km: float, duration_s: float, rng: np.random.Generator
) -> Traffic:
    """Fill the streets, let the traffic settle, and record `duration_s` of it at 17 Hz.

    Args:
        network: the town's network; SUMO's other files are put beside it.
        kind: how dense the traffic is.
        street_km: length of the town's streets.
        duration_s: recorded time after the warm-up.
        rng: source of the seeds that SUMO gets.

    Raises:
        InputError: a tool of SUMO failed, or nobody moved.
    """
    folder = network.parent
    _write_types(folder / "types.add.xml")
    streams = _streams(kind, street_km)
    for stream in streams:
        _write_trips(network, stream, WARM_UP_S + duration_s, int(rng.integers(1 << 30)))
    routes = ",".join(_trip_file(stream) for stream in streams)
    options = ["-n", network.name, "-a", "types.add.xml", "-r", routes, "--seed", str(int(rng.integers(1 << 30)))]
    options += ["--begin", "0", "--end", f"{WARM_UP_S + duration_s:.3f}", "--step-length", str(STEP_S)]
    options += ["--fcd-output", _TRAJECTORIES, "--device.fcd.begin", str(WARM_UP_S)]
    options += ["--fcd-output.attributes", "id,x,y,angle,speed,type", "--precision", "3"]
    options += ["--lanechange.duration", "3", "--collision.action", "remove", "--ignore-route-errors"]
    options += ["--no-step-log", "--no-warnings"]
    run_binary("sumo", options, folder)
    return _read_trajectories(folder / _TRAJECTORIES)


def _streams(kind: TownKind, street_km: float) -> tuple[_Stream, ...]:
    far = ("--min-distance", "200")
    return (
        _Stream("passenger", round(kind.cars * street_km), 75.0, far),
        _Stream("truck", round(kind.trucks * street_km), 75.0, far),
        _Stream("bus", round(kind.buses * street_km), 75.0, far),
        _Stream("bicycle", round(kind.bicycles * street_km), 90.0, far),
        _Stream("pedestrian", round(kind.persons * street_km), 170.0, ("--persons", "--max-distance", "400")),
    )


def _write_types(path: Path) -> None:
    root = ET.Element("additional")
    for sumo_class in dict.fromkeys(user.sumo_class for user in ROAD_USERS):
        group = ET.SubElement(root, "vTypeDistribution", id=_any(sumo_class))
        for user in ROAD_USERS:
            if user.sumo_class == sumo_class:
                size = {"length": str(user.length_m), "width": str(user.width_m), "height": str(user.height_m)}
                size = {} if sumo_class == "pedestrian" else size  # SUMO's own size steers how people evade each other
                kind = {"id": user.name, "vClass": sumo_class, "probability": str(user.share)}
                ET.SubElement(group, "vType", {**kind, **size})
    ET.ElementTree(root).write(path)


def _any(sumo_class: str) -> str:
    """Name the distribution over a class's types, so that it differs from each type's name."""
    return f"any_{sumo_class}"


def _trip_file(stream: _Stream) -> str:
    return f"{stream.sumo_class}.trips.xml"


def _write_trips(network: Path, stream: _Stream, end_s: float, seed: int) -> None:
    """Draw trips and set their departures: enough to fill the streets at once, then as many as arrive."""
    later = round(stream.count * end_s / stream.trip_s)
    attributes = f'type="{_any(stream.sumo_class)}"'
    if stream.sumo_class != "pedestrian":
        attributes += ' departLane="best" departSpeed="max"'
    options = ["-n", network.name, "-o", _trip_file(stream), "--seed", str(seed), "--prefix", stream.sumo_class]
    options += ["--begin", "0", "--end", str(max(stream.count + later, 1)), "--period", "1", "--no-validate"]
    options += ["--edge-permission", stream.sumo_class, "--trip-attributes", attributes, *stream.options]
    run_tool("randomTrips", options, network.parent)
    path = network.parent / _trip_file(stream)
    tree = ET.parse(path)
    for index, trip in enumerate([node for node in tree.getroot() if node.tag in ("trip", "person")]):
        is_first = index < stream.count
        fill_s = 0.4 * WARM_UP_S * index / max(stream.count, 1)
        depart_s = fill_s if is_first else 0.4 * WARM_UP_S + (index - stream.count) * stream.trip_s / stream.count
        trip.set("depart", f"{depart_s:.2f}")
        trip.set("departPos", "random" if stream.sumo_class == "pedestrian" else "random_free" if is_first else "base")
    tree.write(path)


def _read_trajectories(path: Path) -> Traffic:
    try:
        table = pd.read_csv(
            path, sep=";", usecols=_FIELDS, dtype={"vehicle_id": "category", "vehicle_type": "category"}
        )
    except (OSError, ValueError) as error:
        raise InputError(f"SUMO's trajectories cannot be read ({error}); SUMO 1.28 writes them", path=path) from error
    table = table.dropna()
    if table.empty:
        raise InputError("the town is empty: nobody moved", path=path)
    steps, offsets = np.unique(table["timestep_time"].to_numpy(), return_index=True)
    actor = table["vehicle_id"].cat.codes.to_numpy().astype(np.int32)
    type_of_code = np.array([type_index(name) for name in table["vehicle_type"].cat.categories], np.uint8)
    actor_types = np.zeros(int(actor.max()) + 1, np.uint8)
    actor_types[actor] = type_of_code[table["vehicle_type"].cat.codes.to_numpy()]
    return Traffic(
        times_s=steps.astype(np.float64),
        offsets=np.append(offsets, len(table)).astype(np.int64),
        actor=actor,
        position_m=table[["vehicle_x", "vehicle_y"]].to_numpy(np.float32),
        heading_rad=np.deg2rad(90.0 - table["vehicle_angle"].to_numpy()).astype(np.float32),
        speed_mps=table["vehicle_speed"].to_numpy(np.float32),
        actor_types=actor_types,
    )
