"""Runs on a CUDA device: what does not fit is a row's reason, and processes that share the card give the same bytes."""

from dataclasses import replace

import pytest
import torch
import yaml
from support.cuda import NEEDS_CUDA
from support.recordings import random_recording

from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.grids.recording import write_recordings
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.models.checkpoint import WEIGHTS_FILE
from semgrid_eval.models.device import visible_gpus
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.packed import PackedIndex, write_index
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores import results

pytestmark = NEEDS_CUDA
GRID = GridConfig(spec=GridSpec(rows=64, columns=64, agent_row=64, agent_column=32))
TRAINING = {"epochs": 1, "updates_per_epoch": 4, "batch": 8}


@pytest.fixture
def grids(tmp_path):
    """Pack random recordings, two to train on and one to score."""
    folder, logs = tmp_path / "packed", []
    for seed, split in enumerate(("train", "train", "val")):
        recording = random_recording(seed, size=64)
        write_recordings(folder / f"{seed}.npz", [replace(recording, split=split)], owner=recording.digest)
        facts = {"name": recording.name, "path": f"{seed}.mcap", "digest": recording.digest}
        logs.append(results.LogRecord(**facts, split=split, dataset=recording.dataset))
    write_index(folder, PackedIndex(grid=GRID, logs=tuple(logs)))
    return folder


def run(rows, grids, out, executor=None):
    matrix = {"defaults": {"grid": GRID.model_dump(mode="json")}, "models": {"ed": {"training": TRAINING}}}
    path = out.with_suffix(".yaml")
    path.write_text(yaml.safe_dump({**matrix, "rows": rows}))
    options = RunOptions("cuda", out / "unused", "test", executor=executor or InProcess(), pictures=False)
    return run_matrix(load_matrix(str(path)), grids, out, options)


@pytest.fixture
def little_memory():
    """Let this process have 256 MiB of the card at most."""
    torch.cuda.empty_cache()
    total = torch.cuda.get_device_properties(0).total_memory
    torch.cuda.set_per_process_memory_fraction((256 << 20) / total)
    yield
    torch.cuda.set_per_process_memory_fraction(1.0)
    torch.cuda.empty_cache()


@pytest.mark.usefixtures("little_memory")
def test_a_row_that_does_not_fit_says_so_and_the_others_go_on(grids, tmp_path):
    large = {"features": 64, "training": {**TRAINING, "batch": 128}}
    small = {"features": 4, "depth": 2}
    rows = [
        {"name": "large", "model": "ed", "settings": large},
        {"name": "small", "model": "ed", "settings": small},
        {"name": "BL", "model": "newest"},
    ]
    failures = {row.name: row.failure for row in run(rows, grids, tmp_path / "run").rows}
    assert failures.pop("large").startswith("out of memory: CUDA out of memory")
    assert failures == {"small": None, "BL": None}


def test_processes_that_share_the_card_give_the_same_bytes(grids, tmp_path):
    rows = [{"name": "ED", "model": "ed", "settings": {"features": 8}, "repeats": 2}]
    alone = run(rows, grids, tmp_path / "alone")
    beside = run(rows, grids, tmp_path / "beside", Processes(2, gpus=visible_gpus()[:1]))
    assert alone.rows[0].failure is None
    assert beside.rows == alone.rows

    def weights(out):
        return {path.parent.name: path.read_bytes() for path in (out / "trainings").rglob(WEIGHTS_FILE)}

    assert len(weights(tmp_path / "alone")) == 2
    assert weights(tmp_path / "beside") == weights(tmp_path / "alone")
