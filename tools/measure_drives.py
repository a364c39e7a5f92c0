"""Tell how fast the ego vehicles of the simulated town drive and how far they turn, over many windows.

Example: python tools/measure_drives.py towns --windows 400
Options that are not named here are those of `semgrid-eval convert synthetic`.
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.config import parse_config
from semgrid_eval.errors import SemgridError
from semgrid_eval.progress import silent
from semgrid_eval.sources.town.config import FRAME_COUNT, SyntheticConfig
from semgrid_eval.sources.town.drives import FRAME_RATE_HZ, ego_path
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan
from semgrid_eval.sources.town.town import load_town

SLOW_MPS, FAST_MPS, TURN_DEG = 2.0, 11.0, 10.0


def main() -> None:
    """Parse the options, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cache", type=Path, help="folder of the towns")
    parser.add_argument("--windows", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frames", type=int, default=FRAME_COUNT, help="of a window")
    parser.add_argument("--towns", type=int, default=4)
    parser.add_argument("--val-towns", type=int)
    parser.add_argument("--val-share", type=float, default=0.3)
    options = parser.parse_args()
    try:
        names = ("seed", "frames", "towns", "val_towns", "val_share")
        values = {"recordings": options.windows, **{name: getattr(options, name) for name in names}}
        plans = plan_recordings(parse_config(SyntheticConfig, values), options.cache, silent)
        states = np.array([_states(plan) for plan in plans])
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None
    speeds_mps, turns_deg = states[..., 3].mean(axis=1), np.rad2deg(np.abs(states[:, -1, 2] - states[:, 0, 2]))
    moving_mps = speeds_mps[speeds_mps >= SLOW_MPS]
    print(f"{len(plans)} windows of {len({plan.town for plan in plans})} towns")
    print(f"below {SLOW_MPS:g} m/s: {np.mean(speeds_mps < SLOW_MPS):.2f}")
    print(f"median of the others: {np.median(moving_mps):.1f} m/s")
    print(f"above {FAST_MPS:g} m/s: {np.mean(speeds_mps > FAST_MPS):.2f}")
    print(f"frames below {SLOW_MPS:g} m/s: {np.mean(states[..., 3] < SLOW_MPS):.2f}")
    print(f"turning by more than {TURN_DEG:g} degrees: {np.mean(turns_deg > TURN_DEG):.2f}")


def _states(plan: RecordingPlan) -> NDArray[np.float64]:
    """Return x, y, yaw, speed and yaw rate of the frames of a window: (N, 5)."""
    path, start_s = ego_path(load_town(plan.town).traffic, plan.drive), plan.drive.start_s
    assert path is not None
    return np.array([path.at(start_s + index / FRAME_RATE_HZ) for index in range(plan.drive.frames)])


if __name__ == "__main__":
    main()
