"""What a run knows of its logs: grids are made when asked for, and a benchmark's logs are fingerprinted."""

from contextlib import nullcontext
from dataclasses import replace

import pytest
import torch
from support.mapped import NEEDS_PROC, file_of
from support.toy_world import street

from semgrid_eval.executors import InProcess
from semgrid_eval.log.fingerprint import fingerprint
from semgrid_eval.log.recover import recover_log
from semgrid_eval.log.store import write_log
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.matrix import load_matrix


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for dataset in ("town-v1/small", "town-v1/tiny", "own"):
        recording = street(frames=3).recording(dataset.replace("/", "_"), "val")
        write_log(replace(recording, dataset=dataset), folder / "val" / f"{recording.name}.mcap")
    return folder


def data_of(logs, cache, matrix="baselines", stage=silent_stage):
    rows = load_matrix(matrix).rows[:1]
    return RunData(logs, cache, rows, executor=InProcess(), device=torch.device("cpu"), stage=stage)


def test_the_logs_of_a_published_benchmark_alone_are_fingerprinted(logs, tmp_path):
    found = data_of(logs, tmp_path)
    found.prepare()
    assert {record.fingerprint for record in found.records.values()} == {None}
    found.identify()
    assert {record.dataset: record.fingerprint for record in found.records.values()} == {
        "town-v1/small": fingerprint(logs / "val" / "town-v1_small.mcap"),
        "town-v1/tiny": None,
        "own": None,
    }


def test_a_log_that_was_recovered_says_what_it_lost(logs, tmp_path):
    whole = (logs / "val" / "own.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 9 // 10])
    recover_log(tmp_path / "cut.mcap", tmp_path / "logs" / "val" / "saved.mcap")
    write_log(street(frames=3).recording("whole", "val"), tmp_path / "logs" / "val" / "whole.mcap")
    found = data_of(tmp_path / "logs", tmp_path / "cache")
    found.prepare()
    told = {path: record.recovered for path, record in found.records.items()}
    assert told["val/whole.mcap"] == ""
    assert told["val/saved.mcap"].startswith("was recovered from a damaged log, which lost ")


def test_progress_is_told_of_logs_that_cannot_have_what_a_row_looks_at(logs, tmp_path):
    told = []

    def progress(*of):
        told.append(of)

    found = data_of(logs, tmp_path, "sensors", lambda label: nullcontext(progress))
    found.prepare()
    assert told == [(1, 3, "own"), (2, 3, "town-v1_small"), (3, 3, "town-v1_tiny")]
    assert found.failed == {}
    assert "left" in next(iter(found.grids(load_matrix("sensors").rows[0].grid).failed.values()))


@NEEDS_PROC
def test_on_a_cpu_no_grid_stays_in_anonymous_memory(logs, tmp_path):
    found = data_of(logs, tmp_path / "cache")
    found.prepare()
    config = load_matrix("baselines").rows[0].grid
    data = found.data(config, "val")
    assert not any(hasattr(recording, "grids") for recording in found.grids(config).recordings)
    assert file_of(data.grids).startswith(str(tmp_path / "cache"))
