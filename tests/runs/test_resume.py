import multiprocessing

import numpy as np
import pytest
from support.killable import run_here
from support.toy_world import street

from semgrid_eval.log.store import write_log
from semgrid_eval.report.page.write import write_report

KILLS = 20
MATRIX = """
defaults: {window: {step_frames: 3, target_frame: 8}}
models:
  ed: {features: 4, depth: 2, training: {epochs: 6, updates_per_epoch: 4, batch: 2}}
rows:
- {name: BL-DC, model: newest}
- {name: ED-DC, model: ed, repeats: 2}
- {name: ED-NT, model: ed, translate: false}
- {name: BL-Table, model: table}
"""


def outputs(out):
    """Everything that numbers come from, by name; durations are no such thing."""
    report = write_report(out).parent
    files = [report / f"{name}.csv" for name in ("scores", "summary", "training", "settings", "calibration", "windows")]
    files += [*out.glob("results/*/sums.npz"), *out.glob("results/*/predictions.npz"), *out.glob("windows/*.npz")]
    files += [*out.glob("trainings/*/weights.safetensors")]
    return {str(path.relative_to(out)): path.read_bytes() for path in files}


@pytest.mark.slow
def test_runs_killed_at_random_moments_end_with_the_same_bytes(tmp_path):
    for i, split in enumerate(("train", "train", "val")):
        write_log(street(i, frames=9).recording(f"toy{i}", split), tmp_path / "logs" / f"toy{i}.mcap")
    (tmp_path / "m.yaml").write_text(MATRIX)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["support.killable"])

    def start(out):
        process = context.Process(target=run_here, args=(str(tmp_path / "m.yaml"), str(tmp_path / "logs"), str(out)))
        process.start()
        return process

    whole = start(tmp_path / "whole")
    whole.join()
    assert whole.exitcode == 0
    expected = outputs(tmp_path / "whole")
    rng = np.random.default_rng(0)
    kills = finished = 0
    while kills < KILLS or finished == 0:
        out = tmp_path / f"killed{finished}"
        process = start(out)
        process.join(rng.uniform(0.02, 1.2) if kills < KILLS else None)
        if process.exitcode is None:
            process.kill()
            process.join()
            kills += 1
        else:
            assert process.exitcode == 0
            assert outputs(out) == expected
            finished += 1
