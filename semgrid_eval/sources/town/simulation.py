"""Runs SUMO: its tools, who travels when, and the trajectories, which become compact arrays."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.traffic import ROAD_USERS, Traffic, type_index

FILL_S = 24.0
"""Time in which the streets are filled; from then on as many depart as arrive."""
TYPES_FILE = "types.add.xml"
_FAR = ("--min-distance", "200")
STEP_S = 0.059  # SUMO counts whole milliseconds; 1/17 s is 58.8 ms
WARM_UP_S = 60.0
_TRAJECTORIES = "fcd.csv"
_FIELDS = ["timestep_time", "vehicle_id", "vehicle_x", "vehicle_y", "vehicle_angle", "vehicle_speed", "vehicle_type"]


def sumo_home() -> Path:
    """Return the folder of the installed SUMO package."""
    try:
        import sumo
    except ImportError:
        raise MissingExtraError("synthetic", "eclipse-sumo") from None
    return Path(sumo.SUMO_HOME)


def run_binary(name: str, options: list[str], folder: Path) -> None:
    """Run one of SUMO's binaries (`netgenerate`, `netconvert`, `sumo`) inside `folder`; failures speak in its words."""
    _run(name, [str(sumo_home() / "bin" / name), *options], folder)


def run_tool(name: str, options: list[str], folder: Path) -> None:
    """Run one of SUMO's Python tools (`randomTrips`) inside `folder`, likewise."""
    _run(name, [sys.executable, str(sumo_home() / "tools" / f"{name}.py"), *options], folder)


def _run(name: str, command: list[str], folder: Path) -> None:
    environment = {**os.environ, "SUMO_HOME": str(sumo_home())}
    try:
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    except OSError as error:
        raise InputError(f"SUMO's {name} cannot be started: {error.strerror or error}") from error
    if done.returncode < 0:
        raise InputError(f"SUMO's {name} was killed by signal {-done.returncode} (out of memory?)")
    if done.returncode > 0:
        raise InputError(f"SUMO's {name} failed with exit code {done.returncode}: {_fault(done.stderr + done.stdout)}")


def _fault(output: str) -> str:
    """Pick SUMO's own reason: its lines that start with `Error:`, else the last thing that it said."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    faults = [line.removeprefix("Error:").strip() for line in lines if line.startswith("Error:")]
    return "; ".join(faults[:3]) or (lines[-1] if lines else "no message")


class _Stream(NamedTuple):
    """Trips over one kind of lane: SUMO's classes that travel it, how long a trip takes, and options of the tool."""

    permission: str
    classes: tuple[str, ...]
    trip_s: float
    options: tuple[str, ...]

    @property
    def file(self) -> str:
        return f"{self.permission}.trips.xml"


_STREAMS = (
    _Stream("passenger", ("passenger", "truck", "bus"), 75.0, _FAR),
    _Stream("bicycle", ("bicycle",), 90.0, _FAR),
    _Stream("pedestrian", ("pedestrian",), 170.0, ("--persons",)),
)


def write_demand(network: Path, kind: TownKind, street_km: float, end_s: float, rng: np.random.Generator) -> list[str]:
    """Write types and trips of everybody beside the network and return the names of the files of trips."""
    _write_types(network.parent / TYPES_FILE)
    density = {"passenger": kind.cars, "truck": kind.trucks, "bus": kind.buses}
    density |= {"bicycle": kind.bicycles, "pedestrian": kind.persons}
    for stream in _STREAMS:
        users = [user for user in ROAD_USERS if user.sumo_class in stream.classes]
        per_km = {user.name: density[user.sumo_class] * user.share for user in users}
        _write_trips(network, stream, per_km, street_km, end_s, rng)
    return [stream.file for stream in _STREAMS]


def _write_types(path: Path) -> None:
    root = ET.Element("additional")
    for user in ROAD_USERS:
        size = {"length": str(user.length_m), "width": str(user.width_m), "height": str(user.height_m)}
        size = {} if user.sumo_class == "pedestrian" else size  # SUMO's own size steers how people evade each other
        ET.SubElement(root, "vType", {"id": user.name, "vClass": user.sumo_class, **size})
    ET.ElementTree(root).write(path)


def _write_trips(
    network: Path, stream: _Stream, per_km: dict[str, float], street_km: float, end_s: float, rng: np.random.Generator
) -> None:
    """Draw trips, then set who makes each and when: enough to fill the streets at once, then as many as arrive."""
    users, weights = list(per_km), np.array(list(per_km.values()))
    at_a_time = max(1, round(float(weights.sum()) * street_km))
    count = at_a_time + round(at_a_time * end_s / stream.trip_s)
    options = ["-n", network.name, "-o", stream.file, "--seed", str(int(rng.integers(1 << 30)))]
    options += ["--prefix", stream.permission, "--begin", "0", "--end", str(count), "--period", "1", "--no-validate"]
    run_tool("randomTrips", [*options, "--edge-permission", stream.permission, *stream.options], network.parent)
    path = network.parent / stream.file
    tree = ET.parse(path)
    trips = [node for node in tree.getroot() if node.tag in ("trip", "person")]
    for index, trip in enumerate(trips):
        is_first = index < at_a_time
        late_s = (index - at_a_time) * stream.trip_s / at_a_time
        trip.set("depart", f"{FILL_S * index / at_a_time if is_first else FILL_S + late_s:.2f}")
        trip.set("type", users[int(rng.choice(len(users), p=weights / weights.sum()))])
        if trip.tag == "person":
            trip.set("departPos", "random")
        else:
            trip.attrib.update(departLane="best", departSpeed="max", departPos="random_free" if is_first else "base")
    tree.write(path)


def simulate_traffic(
    network: Path, kind: TownKind, street_km: float, duration_s: float, rng: np.random.Generator
) -> Traffic:
    """Fill the streets, let the traffic settle, and record `duration_s` of it at 17 Hz.

    SUMO's files are put beside the file of the network, whose streets have a length of `street_km`.
    """
    folder = network.parent
    routes = write_demand(network, kind, street_km, WARM_UP_S + duration_s, rng)
    options = ["-n", network.name, "-a", TYPES_FILE, "-r", ",".join(routes), "--seed", str(int(rng.integers(1 << 30)))]
    options += ["--begin", "0", "--end", f"{WARM_UP_S + duration_s:.3f}", "--step-length", str(STEP_S)]
    options += ["--fcd-output", _TRAJECTORIES, "--device.fcd.begin", str(WARM_UP_S)]
    options += ["--fcd-output.attributes", "id,x,y,angle,speed,type", "--precision", "3"]
    options += ["--lanechange.duration", "3", "--collision.action", "remove", "--ignore-route-errors"]
    options += ["--no-step-log", "--no-warnings"]
    run_binary("sumo", options, folder)
    return _read_trajectories(folder / _TRAJECTORIES)


def _read_trajectories(path: Path) -> Traffic:
    try:
        table = pd.read_csv(
            path, sep=";", usecols=_FIELDS, dtype={"vehicle_id": "category", "vehicle_type": "category"}
        )
    except (OSError, ValueError) as error:
        raise InputError(f"SUMO's trajectories cannot be read ({error}); SUMO 1.28 writes them", path=path) from error
    table = table.dropna()
    if table.empty:
        raise InputError("the town is empty: nobody moved in it; ask for a larger town or a longer time")
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
