"""Runs beside and after each other on one folder, models that change, and what libraries raise."""

import errno
import shutil
import time
from dataclasses import replace
from threading import Thread

import pytest
import torch
import yaml
from support.toy_world import street

from semgrid_eval.errors import ConfigError
from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.files import locked
from semgrid_eval.log.store import write_log
from semgrid_eval.runs import plan
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores import results

TINY = {"ed": {"features": 4, "depth": 2, "training": {"epochs": 1, "updates_per_epoch": 2, "batch": 2}}}
BL, ED = {"name": "BL", "model": "newest"}, {"name": "ED", "model": "ed"}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    for i, split in enumerate(("train", "val")):
        write_log(street(i, frames=9).recording(f"toy_{i:06}_000000", split), folder / split / f"toy{i}.mcap")
    return folder


@pytest.fixture
def work(logs, tmp_path):
    """Run rows on one folder; `executor` and the names of rows may be given."""

    def run(rows, executor=None, only=()):
        window = {"step_frames": 1, "horizon_steps": 1, "target_frame": 6}
        path = tmp_path / "matrix.yaml"
        path.write_text(yaml.safe_dump({"models": TINY, "defaults": {"window": window}, "rows": rows}))
        options = RunOptions("cpu", tmp_path / "grids", "test", only, executor or InProcess())
        return run_matrix(load_matrix(str(path)), logs, tmp_path / "run", options)

    run.options = RunOptions("cpu", tmp_path / "grids", "test")
    run.out = tmp_path / "run"
    return run


def failures(record):
    return {row.name: row.failure for row in record.rows}


@pytest.mark.slow
def test_rows_that_processes_have_trained_are_known_when_others_are_asked_for(work):
    trained = work([BL, ED], Processes(2))
    again = work([BL, ED], Processes(2), only=("BL",))
    assert failures(again) == {"BL": None, "ED": None}
    assert again.rows == trained.rows
    assert again.machine == trained.machine


class During(InProcess):
    """Works in this process, and meanwhile somebody else does something."""

    def __init__(self, other):
        self._other = other

    def run(self, function, items):
        self._other()
        yield from super().run(function, items)


def test_what_another_run_does_meanwhile_is_in_the_record(work):
    record = work([BL, ED], During(lambda: work([BL, ED], only=("ED",))), only=("BL",))
    assert failures(record) == {"BL": None, "ED": None}
    assert results.read_run(work.out) == record


def test_a_misspelt_row_is_told_before_anything_is_built(work, tmp_path):
    with pytest.raises(ConfigError, match="'BB' is not one of BL, ED"):
        work([BL, ED], only=("BB",))
    assert not (tmp_path / "grids").exists()


def test_a_training_that_is_complete_is_read_without_writing(work):
    work([ED])
    (training,) = (work.out / "trainings").iterdir()
    before = training.stat().st_mtime_ns
    shutil.rmtree(work.out / "results")
    assert failures(work([ED])) == {"ED": None}
    assert training.stat().st_mtime_ns == before
    assert {path.name for path in training.iterdir()} == {"weights.safetensors", "history.csv"}


def test_where_there_are_no_locks_nobody_waits(tmp_path, monkeypatch):
    def refuse(*_args):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with locked(tmp_path):
        pass


@pytest.mark.parametrize(
    ("message", "told"),
    [
        ("cuDNN error: CUDNN_STATUS_NOT_INITIALIZED\nmore", "RuntimeError: cuDNN error: CUDNN_STATUS_NOT_INITIALIZED"),
        ("DefaultCPUAllocator: can't allocate memory", "out of memory: DefaultCPUAllocator: can't allocate memory"),
    ],
)
def test_what_libraries_raise_is_a_reason_and_the_others_go_on(work, monkeypatch, message, told):
    def fail(*_args, **_kwargs):
        raise RuntimeError(message)

    monkeypatch.setattr("semgrid_eval.models.fitting.train", fail)
    assert failures(work([ED, BL])) == {"ED": told, "BL": None}


def test_a_row_whose_sample_cannot_be_trained_does_not_end_the_plan(work, logs, tmp_path, monkeypatch):
    work([BL])

    def fail(*_args, **_kwargs):
        raise torch.OutOfMemoryError("CUDA out of memory.\nTried to allocate")

    monkeypatch.setattr(plan, "make_ready", fail)
    (tmp_path / "matrix.yaml").write_text(yaml.safe_dump({"models": TINY, "rows": [ED, BL]}))
    units = plan.plan_run(load_matrix(str(tmp_path / "matrix.yaml")), logs, work.out, work.options)
    assert units[0].rows == ("ED",)
    assert units[0].failure is not None


def test_one_at_a_time_works_under_a_lock(tmp_path):
    seen = []

    def work():
        with locked(tmp_path / "folder" / "training"):
            seen.append("begun")
            time.sleep(0.05)
            seen.append("done")

    threads = [Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == ["begun", "done"] * 3


def test_networks_of_other_machines_are_taken_where_that_is_asked_for(work, logs, monkeypatch):
    work([ED])
    trained = work.out / "trainings"
    monkeypatch.setattr("semgrid_eval.runs.worker.choose_precision", lambda *_: torch.bfloat16)  # another machine's
    matrix = load_matrix(str(work.out.parent / "matrix.yaml"))
    options = replace(work.options, trainings=trained, any_machine=True)
    before = sorted(trained.iterdir())
    taken = run_matrix(matrix, logs, work.out.parent / "taken", options)
    assert failures(taken) == {"ED": None}
    assert sorted(trained.iterdir()) == before
    assert [row.results for row in taken.rows] == [row.results for row in results.read_run(work.out).rows]
    run_matrix(matrix, logs, work.out.parent / "anew", replace(options, any_machine=False))
    assert len(list(trained.iterdir())) == len(before) + 1


def test_a_training_that_is_not_finished_is_nobody_elses(work, logs, monkeypatch):
    work([ED])
    trained = work.out / "trainings"
    (weights,) = trained.glob("*/weights.safetensors")
    weights.unlink()
    monkeypatch.setattr("semgrid_eval.runs.worker.choose_precision", lambda *_: torch.bfloat16)
    options = replace(work.options, trainings=trained, any_machine=True)
    run_matrix(load_matrix(str(work.out.parent / "matrix.yaml")), logs, work.out.parent / "taken", options)
    assert len(list(trained.glob("*/weights.safetensors"))) == 1
    assert len(list(trained.iterdir())) == 2
