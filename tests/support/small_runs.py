"""Small runs on logs of a toy street, which take a second or two."""

import yaml
from support.toy_world import street

from semgrid_eval.executors import InProcess
from semgrid_eval.log.store import write_log
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores import results

WINDOW = {"step_frames": 3, "target_frame": 8}
SPLITS = ("train", "train", "val", "val")
TINY = {"ed": {"features": 4, "depth": 2, "training": {"epochs": 2, "updates_per_epoch": 3, "batch": 2}}}


def write_logs(folder):
    """Write a log of nine frames for each of `SPLITS`."""
    for i, split in enumerate(SPLITS):
        world = street(i, frames=9, speed_mps=8 + i, yaw_rate_radps=0.1 * (i - 1), noise_px=0.05)
        write_log(world.recording(f"toy_{i:06}_000000", split), folder / split / f"toy{i}.mcap")
    return folder


def run(rows, logs, out, executor=None, only=(), *, folders=None, **defaults):
    """Run rows with these defaults; `folders` gives options of the run."""
    path = out.parent / f"{out.name}.yaml"
    path.write_text(
        yaml.safe_dump({"seed": 5, "models": TINY, "defaults": {"window": WINDOW, **defaults}, "rows": rows})
    )
    options = RunOptions("cpu", out.parent / "grids", "test", only, executor or InProcess(), **(folders or {}))
    return run_matrix(load_matrix(str(path)), logs, out, options)


def result_of(out, row):
    """Read the first result of a row that did not fail."""
    assert row.failure is None, row.failure
    return results.read_result(results.result_folder(out, row.results[0]))
