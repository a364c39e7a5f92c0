"""The check on a GPU, reduced to the least of everything and on the CPU."""

import importlib.util
import json
import subprocess
import sys
import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.recordings import random_recording
from support.small_runs import SPLITS, write_logs

from semgrid_eval.bench.archives import pack_run
from semgrid_eval.bench.paper import kept_scores, matrix_of_grids
from semgrid_eval.files import write_json
from semgrid_eval.grids.recording import write_recordings
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.runs.packed import PackedIndex, write_index
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores.results import LogRecord

ROOT = Path(__file__).parents[2]
TOOL = ROOT / "tools" / "gpu_check.py"
SENSORS = tuple(GridConfig().sensors)


@pytest.fixture(scope="module")
def carried(tmp_path_factory):
    """What is carried along: grids of two recordings to train on and two to score."""
    folder, logs = tmp_path_factory.mktemp("carried"), []
    for seed, split in enumerate(("train", "train", "val", "val")):
        coarse = random_recording(seed, size=16, sensors=SENSORS, truth=True)
        fine = {name: np.kron(getattr(coarse, name), np.ones((8, 8), np.uint8)) for name in ("grids", "actors")}
        recording = replace(coarse, split=split, **fine)
        write_recordings(folder / "grids" / f"{seed}.npz", [recording], owner=recording.digest)
        facts = {"name": recording.name, "path": f"{seed}.mcap", "digest": recording.digest}
        logs.append(LogRecord(**facts, split=split, dataset=recording.dataset))
    write_index(folder / "grids", PackedIndex(grid=GridConfig(), logs=tuple(logs)))
    return folder


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("gpu_check", TOOL)
    module = importlib.util.module_from_spec(spec)
    sys.modules["gpu_check"] = module  # dataclasses look for it there
    spec.loader.exec_module(module)
    return module


def check(carried, out, *parts, options=()):
    """Run parts on the CPU; return the exit code and what is printed."""
    options = ["--data", carried, "--out", out, "--device", "cpu", "--commit", "abc", "--smoke", *options]
    command = [sys.executable, TOOL, "run", *options, *(word for part in parts for word in ("--part", part))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def figures(out, part):
    return json.loads((out / f"{part}.json").read_text())


@pytest.mark.slow
def test_rates_then_rows_are_measured_scored_and_priced(carried, tmp_path):
    earlier = tmp_path / "out-work" / "paper" / "run" / "trainings" / "0"
    earlier.mkdir(parents=True)
    code, printed = check(carried, tmp_path / "out", "rates:300", "paper:300")
    assert code == 0, printed
    rates, paper = figures(tmp_path / "out", "rates"), figures(tmp_path / "out", "paper")
    assert rates["complete"]
    assert paper["complete"]
    assert paper["commit"] == "abc"
    assert rates["figures"]["trained, eager"]["value"] > 0
    assert list(paper["rows"]) == ["BL-DC", "BL-Fuse", "ED-DC"]
    row = paper["rows"]["ED-DC"]
    assert row["updates"] == 1
    assert row["scores_of_reference"] == kept_scores(ROOT / "reports" / "reference")["ED-DC"]
    value, low, high = row["minus"]["BL-Fuse"]["mean_known"]
    assert low <= value <= high
    assert value == pytest.approx(
        row["scores"]["mean_known"][0] - paper["rows"]["BL-Fuse"]["scores"]["mean_known"][0], abs=2e-4
    )
    assert paper["whole_preset"]["trainings"] == 200
    assert not earlier.exists()  # what it trained would make the price too low
    assert "== paper: complete" in printed
    assert "the paper's own rows, estimated" in printed
    with tarfile.open(tmp_path / "out" / "paper-run.tar.gz") as archive:
        assert "run/run.json" in archive.getnames()


@pytest.mark.slow
def test_without_a_card_every_test_of_it_is_skipped(carried, tmp_path):
    code, printed = check(carried, tmp_path / "out", "tests:300")
    assert code == 0, printed
    found = figures(tmp_path / "out", "tests")
    assert found["complete"]
    assert set(found["tests"].values()) == {"SKIPPED"}
    marked = {path for path in ROOT.glob("tests/**/test_*.py") if "NEEDS_CUDA" in path.read_text()} - {Path(__file__)}
    assert {ROOT / name.partition("::")[0] for name in found["tests"]} == marked


@pytest.mark.slow
def test_a_preset_is_trained_on_grids_alone_and_what_it_trained_is_found_where_the_rest_is(carried, tmp_path):
    code, printed = check(carried, tmp_path / "out", "reference:300", options=["--weights", "reference", "--jobs", "2"])
    assert code == 0, printed
    found = figures(tmp_path / "out", "reference")
    assert found["complete"]
    assert found["processes"] == 2
    assert set(found["rows"]) == {"BL-DC", "ED-DC", "BL-Sp1", "RN-DC", "BL-Fuse", "BL-Table", "BL-Flow"}
    for name in ("reference-run.tar.gz", "reference-weights-0.tar.gz"):
        with tarfile.open(tmp_path / "out" / name) as archive:
            archive.extractall(tmp_path / "back", filter="data")
    options = RunOptions("cpu", tmp_path / "grids", "here", trainings=tmp_path / "back/run/trainings", any_machine=True)
    run_matrix(matrix_of_grids("reference", smoke=True), carried / "grids", tmp_path / "again", options)
    assert len(list(tmp_path.glob("back/run/trainings/*/weights.safetensors"))) == 2
    assert not list(tmp_path.glob("again/trainings/*"))
    (back,), (again,) = (load_runs([folder]) for folder in (tmp_path / "back" / "run", tmp_path / "again"))
    ids = [{row.name: row.results[0].record.id for row in run.rows if "-DC" in row.name} for run in (back, again)]
    assert ids[0] == ids[1]


def test_grids_are_packed_and_more_than_can_be_carried_is_told(tool, tmp_path, monkeypatch, capsys):
    logs = write_logs(tmp_path / "logs")
    words = ["gpu_check.py", "pack", str(tmp_path / "carry"), "--logs", str(logs)]
    for limit_mb, code in ((50, 0), (0.001, 1)):
        monkeypatch.setattr(tool, "CARRIED_MB", limit_mb)
        monkeypatch.setattr(sys, "argv", words)
        assert tool.main() == code
        assert ("more than" in capsys.readouterr().out) == bool(code)
    assert len(list((tmp_path / "carry" / "grids").rglob("*.npz"))) == len(SPLITS)


def test_archives_of_a_run_stay_below_what_comes_through(tmp_path, monkeypatch):
    for number, size in enumerate((40, 70, 20, 200)):
        training = tmp_path / "run" / "trainings" / str(number)
        training.mkdir(parents=True)
        (training / "weights.safetensors").write_bytes(bytes(size))
    (tmp_path / "run" / "trainings" / "unfinished").mkdir()
    monkeypatch.setattr("semgrid_eval.bench.archives.LARGEST_BYTES", 100)
    pack_run(tmp_path / "run", tmp_path / "some", weights=True)
    packed = []
    for path in sorted(tmp_path.glob("some-weights-*")):
        with tarfile.open(path) as archive:
            packed.append([name for name in archive.getnames() if name.count("/") == 2])
    assert packed == [["run/trainings/0"], ["run/trainings/1", "run/trainings/2"], ["run/trainings/3"]]


@pytest.mark.slow
def test_parts_that_fail_or_take_too_long_are_told_and_the_next_begins(tmp_path):
    code, printed = check(tmp_path / "nothing", tmp_path, "rates:0.2", "paper:120")
    assert code == 1
    assert f"{tmp_path}/nothing/grids" in printed
    assert "== paper: failed" in printed
    assert "== rates: stopped at its time" in printed


LOG = """\
tests/windows/test_cuda.py::test_content_moves_as_on_the_cpu PASSED [ 20%]
tests/models/test_cuda.py::test_a_checkpoint_goes_on[to cuda-ed] FAILED [ 40%]
tests/runs/test_cuda.py::test_a_row_that_does_not_fit SKIPPED (torch finds no CUDA device) [ 60%]
tests/runs/test_cuda.py::test_processes_that_share"""


def test_the_outcomes_of_tests_are_read_while_they_run(tool, tmp_path):
    (tmp_path / "tests.log").write_text(LOG)
    assert tool.outcomes(tmp_path / "tests.log") == {
        "tests/windows/test_cuda.py::test_content_moves_as_on_the_cpu": "PASSED",
        "tests/models/test_cuda.py::test_a_checkpoint_goes_on[to cuda-ed]": "FAILED",
        "tests/runs/test_cuda.py::test_a_row_that_does_not_fit": "SKIPPED",
    }


@pytest.mark.parametrize(
    ("alone", "two", "four", "expected"), [(100, 110, 112, 1), (100, 150, 160, 4), (100, 150, 90, 2)]
)
def test_rows_are_trained_beside_each_other_where_that_is_faster(tool, tmp_path, alone, two, four, expected):
    found = {"trained, eager": alone, "trained by 2 processes": two, "trained by 4 processes": four}
    write_json(tmp_path / "rates.json", {"figures": {what: {"value": value} for what, value in found.items()}})
    assert tool.processes_at_once(tmp_path / "rates.json") == expected
    assert tool.processes_at_once(tmp_path / "none.json") == 1
