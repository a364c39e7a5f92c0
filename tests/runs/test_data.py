"""What a run knows of its logs: grids are made when asked for, and a benchmark's logs are fingerprinted."""

from dataclasses import replace

import pytest
import torch
from support.toy_world import street

from semgrid_eval.executors import InProcess
from semgrid_eval.log.fingerprint import fingerprint
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


def data_of(logs, cache):
    rows = load_matrix("baselines").rows[:1]
    return RunData(logs, cache, rows, executor=InProcess(), device=torch.device("cpu"), stage=silent_stage)


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
