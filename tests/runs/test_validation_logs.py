"""Logs to score that differ from those to train on: of another frame rate, or in another folder."""

import shutil

import pytest
import torch
from support.small_runs import SPLITS, run
from support.toy_world import street

from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.log.store import write_log
from semgrid_eval.scores import results


def test_recordings_of_another_frame_rate_are_scored_in_windows_of_their_own(logs, tmp_path):
    rows = [{"name": "ED-DC", "model": "ed", "validation_window": {"step_frames": 2, "target_frame": None}}]
    record = run(rows, logs, tmp_path / "run")
    assert record.rows[0].failure is None
    assert record.rows[0].facts.step_frames == 2
    result = results.read_result(results.result_folder(tmp_path / "run", record.rows[0].results[0]))
    assert [window.target_frame for window in result.windows] == [4, 5, 6, 7, 8] * 2


@pytest.mark.slow
@pytest.mark.parametrize("executor", [InProcess(), Processes(2, threads=torch.get_num_threads())])
def test_logs_of_another_folder_are_scored_with_the_networks_that_another_run_trained(logs, tmp_path, executor):
    write_log(street(5, frames=7).recording("real", "val"), tmp_path / "real" / "real.mcap")
    rows = [{"name": "ED-DC", "model": "ed"}, {"name": "BL-Table", "model": "table"}, {"name": "BL", "model": "newest"}]
    run(rows, logs, tmp_path / "town")
    trained = {path: path.stat().st_mtime_ns for path in (tmp_path / "town" / "trainings").rglob("*")}
    folders = {"validation_logs": tmp_path / "real", "trainings": tmp_path / "town" / "trainings"}
    scored_windows = {"step_frames": 2, "target_frame": None}
    real = tmp_path / "real_run"
    record = run(rows, logs, real, executor, folders=folders, validation_window=scored_windows)
    assert [row.failure for row in record.rows] == [None] * 3
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "town" / "trainings").rglob("*")} == trained
    assert not (real / "trainings").exists()
    assert [log.path for log in record.logs] == ["real.mcap", *(f"{s}/toy{i}.mcap" for i, s in enumerate(SPLITS))]
    for row in record.rows:
        result = results.read_result(results.result_folder(real, row.results[0]))
        assert [(window.recording, window.target_frame) for window in result.windows] == [
            ("real", 4),
            ("real", 5),
            ("real", 6),
        ]
        assert {window.log for window in result.windows} == {"real.mcap"}
    again = run(
        rows, logs, tmp_path / "alone", folders={"validation_logs": tmp_path / "real"}, validation_window=scored_windows
    )
    assert [row.results for row in again.rows] == [row.results for row in record.rows]


def test_logs_of_both_folders_that_fail_are_told_even_under_one_path(logs, tmp_path):
    for name in ("town", "real"):
        shutil.copytree(logs, tmp_path / name)
        (tmp_path / name / "val" / "broken.mcap").write_bytes(name.encode())
    record = run(
        [{"name": "BL-DC", "model": "newest"}],
        tmp_path / "town",
        tmp_path / "run",
        folders={"validation_logs": tmp_path / "real"},
    )
    assert list(record.failed_logs) == ["val/broken.mcap"]
    assert record.failed_logs["val/broken.mcap"].count("val/broken.mcap: ") == 2
    assert record.rows[0].failure is None


def test_logs_to_train_on_need_none_to_validate(logs, tmp_path):
    folders = {"validation_logs": logs / "val"}
    record = run([{"name": "ED-DC", "model": "ed"}], logs / "train", tmp_path / "run", folders=folders)
    assert record.rows[0].failure is None
    history = results.read_history(results.result_folder(tmp_path / "run", record.rows[0].results[0]))
    assert history["validation_loss"].isna().all()
