"""Simulates a town's traffic with SUMO and turns its trajectories into compact arrays."""

from pathlib import Path

import numpy as np
import pandas as pd

from semgrid_eval.errors import InputError
from semgrid_eval.sources.town.demand import TYPES_FILE, write_demand
from semgrid_eval.sources.town.kinds import TownKind
from semgrid_eval.sources.town.road_users import type_index
from semgrid_eval.sources.town.sumo import run_binary
from semgrid_eval.sources.town.traffic import Traffic

STEP_S = 0.059  # SUMO counts whole milliseconds; 1/17 s is 58.8 ms
WARM_UP_S = 60.0
_TRAJECTORIES = "fcd.csv"
_FIELDS = ["timestep_time", "vehicle_id", "vehicle_x", "vehicle_y", "vehicle_angle", "vehicle_speed", "vehicle_type"]


def simulate_traffic(
    network: Path, kind: TownKind, street_km: float, duration_s: float, rng: np.random.Generator
) -> Traffic:
    """Fill the streets, let the traffic settle, and record `duration_s` of it at 17 Hz.

    SUMO's files are put beside the file of the network, whose streets have a length of `street_km`.

    Raises:
        InputError: a tool of SUMO failed, or nobody moved.
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
