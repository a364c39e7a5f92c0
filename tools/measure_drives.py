"""Tell how fast the ego vehicles of the simulated town drive and how far they turn, over many windows.

Example: python tools/measure_drives.py towns --windows 400
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from pathlib import Path

import numpy as np

from semgrid_eval.config import parse_config
from semgrid_eval.errors import SemgridError
from semgrid_eval.progress import silent
from semgrid_eval.sources.town.drives import FRAME_COUNT, FRAME_RATE_HZ, ego_path
from semgrid_eval.sources.town.recordings import SyntheticConfig, plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan
from semgrid_eval.sources.town.town import load_town

SLOW_MPS, FAST_MPS, TURN_DEG = 2.0, 11.0, 10.0


def main() -> None:
    """Parse the options, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cache", type=Path, help="folder of the towns")
    parser.add_argument("--windows", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    try:
        config = parse_config(SyntheticConfig, {"recordings": options.windows, "seed": options.seed})
        plans = plan_recordings(config, options.cache, silent)
        speeds_mps, turns_deg = np.array([_drive(plan) for plan in plans]).T
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None
    moving_mps = speeds_mps[speeds_mps >= SLOW_MPS]
    print(f"{len(plans)} windows of {len({plan.town for plan in plans})} towns")
    print(f"below {SLOW_MPS:g} m/s: {np.mean(speeds_mps < SLOW_MPS):.2f}")
    print(f"median of the others: {np.median(moving_mps):.1f} m/s")
    print(f"above {FAST_MPS:g} m/s: {np.mean(speeds_mps > FAST_MPS):.2f}")
    print(f"turning by more than {TURN_DEG:g} degrees: {np.mean(turns_deg > TURN_DEG):.2f}")


def _drive(plan: RecordingPlan) -> tuple[float, float]:
    """Return the mean speed (m/s) over a window, and how far it turns (degrees)."""
    path = ego_path(load_town(plan.town).traffic, plan.drive)
    assert path is not None
    states = np.array([path.at(plan.drive.start_s + index / FRAME_RATE_HZ) for index in range(FRAME_COUNT)])
    return float(states[:, 3].mean()), float(np.rad2deg(abs(states[-1, 2] - states[0, 2])))


if __name__ == "__main__":
    main()
