"""Rows that are told of the truth, and the second target: on logs that tell, and on logs that do not."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml
from support.drawn_again import write_town_like
from support.planned import planned
from support.recordings import random_recording
from support.small_runs import WINDOW, run, write_logs

from semgrid_eval.executors import Processes
from semgrid_eval.grids.draws import Draws
from semgrid_eval.grids.recording import FORMAT_VERSION
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import TRUTH_VERSION
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import Network
from semgrid_eval.models.registry import MODELS, find_model
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.plan import plan_run
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.runner import RunOptions
from semgrid_eval.runs.truth import parts_of, told
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import EXPECTED_FILE, SUMS_FILE, read_sums
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings

TOLD = [{"name": "top", "model": "ceiling", "settings": {"draws": 5}}, {"name": "new", "model": "fresh"}]
SAME = {"name": "same", "model": "fresh", "settings": {"seen_is_known": False}}
MOVED = {"name": "moved", "model": "true_motion"}
PLAIN = [{"name": "BL-DC", "model": "newest"}, {"name": "BL-Fuse", "model": "fuse"}]


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return write_town_like(tmp_path_factory.mktemp("town"))


@pytest.fixture(scope="module")
def out(logs, tmp_path_factory):
    """A run with both targets, read only."""
    folder = tmp_path_factory.mktemp("run") / "run"
    run([*PLAIN, *TOLD, SAME, MOVED], logs, folder, second_target="expected")
    return folder


def folder_of(out, name):
    (row,) = [row for row in results.read_run(out).rows if row.name == name]
    assert row.failure is None, row.failure
    return results.result_folder(out, row.results[0])


def right(out, name, file=SUMS_FILE):
    """The share of cells that a row has right, which is what the likeliest class is best at."""
    counts = read_sums(folder_of(out, name), "iou", "all", file=file)[:, 0].sum(axis=0)
    return np.trace(counts) / counts.sum()


def test_who_knows_the_world_has_more_cells_right_than_who_sees_the_inputs(out):
    assert right(out, "top") > max(right(out, "BL-DC"), right(out, "BL-Fuse"))
    assert right(out, "new") > right(out, "BL-DC")


def test_where_nobody_moves_true_motion_is_the_overlay(out):
    mine, other = (results.read_predictions(folder_of(out, name))["prediction"] for name in ("moved", "BL-Fuse"))
    np.testing.assert_array_equal(mine, other)


def test_rows_say_that_they_are_told_of_the_truth(out):
    facts = {row.name: row.facts for row in results.read_run(out).rows}
    assert {name: each.uses_truth for name, each in facts.items()} == {
        "BL-DC": False,
        "BL-Fuse": False,
        "top": True,
        "new": True,
        "same": True,
        "moved": True,
    }
    assert {name for name, each in facts.items() if each.bound == "upper"} == {"top"}
    assert not any(each.baseline for each in facts.values() if each.uses_truth)


def test_the_second_target_is_what_most_draws_of_new_errors_say(out):
    sums = read_sums(folder_of(out, "same"), "iou", "all", file=EXPECTED_FILE)[:, 0]
    assert (sums == sums * np.eye(10, dtype=int)).all(), "15 draws of new errors are that target itself"
    assert right(out, "BL-Fuse", EXPECTED_FILE) != right(out, "BL-Fuse")
    measured, expected = (
        read_sums(folder_of(out, "BL-DC"), "iou", "all", file=file) for file in (SUMS_FILE, EXPECTED_FILE)
    )
    assert measured.sum(axis=-2).tolist() != expected.sum(axis=-2).tolist(), "each target has a mask of its own"


def test_a_second_target_changes_no_score_against_the_first(out, logs, tmp_path):
    run(PLAIN, logs, tmp_path / "run")
    for name in ("BL-DC", "BL-Fuse"):
        one, other = (read_sums(folder_of(each, name), "iou", "all") for each in (out, tmp_path / "run"))
        np.testing.assert_array_equal(one, other)
        assert not (folder_of(tmp_path / "run", name) / EXPECTED_FILE).exists()


def test_on_logs_without_the_truth_such_rows_are_skipped_in_a_line_and_others_go_on(tmp_path):
    logs = write_logs(tmp_path / "logs")
    record = run([*PLAIN, *TOLD, MOVED], logs, tmp_path / "run", second_target="expected")
    skipped = {row.name: row.skipped for row in record.rows}
    assert skipped["BL-DC"] is skipped["BL-Fuse"] is None
    assert not any(row.failure for row in record.rows)
    for name in ("top", "new"):
        assert re.fullmatch(
            r"\S+toy2\.mcap: holds no exact pictures whose errors can be drawn again: .*", skipped[name]
        )
    assert "which pixels show whom" in skipped["moved"]
    assert not (folder_of(tmp_path / "run", "BL-DC") / EXPECTED_FILE).exists()


def _planned(rows, logs, folder, **defaults):
    folder.mkdir(exist_ok=True)
    path = folder / "m.yaml"
    path.write_text(yaml.safe_dump({"seed": 5, "defaults": {"window": WINDOW, **defaults}, "rows": rows}))
    planned = plan_run(load_matrix(str(path)), logs, folder / "run", RunOptions("cpu", folder / "grids", "test"))
    return {unit.rows[0]: unit for unit in planned}


def test_a_plan_prices_what_is_asked_of_the_truth_once_and_no_more_when_it_is_known(logs, tmp_path):
    rows = [PLAIN[0], TOLD[1], {**TOLD[1], "name": "again", "mask_mode": "off"}]
    found = _planned(rows, logs, tmp_path / "plan")
    assert {name: unit.seconds > 0 for name, unit in found.items()} == {"BL-DC": False, "new": True, "again": False}
    run(rows, logs, tmp_path / "plan" / "run")  # which finds its grids beside it
    assert all(unit.seconds == 0 for unit in _planned(rows, logs, tmp_path / "plan").values())


def test_a_plan_says_which_rows_are_skipped_for_lack_of_a_truth(tmp_path):
    found = _planned([*PLAIN, *TOLD], write_logs(tmp_path / "logs"), tmp_path / "plan", second_target="expected")
    assert {name: unit.skipped is not None for name, unit in found.items()} == {
        **{"BL-DC": False, "BL-Fuse": False},
        **{"top": True, "new": True},
    }
    assert not any(unit.failure for unit in found.values())


@pytest.mark.slow
def test_processes_give_the_same_as_this_one(out, logs, tmp_path):
    run([PLAIN[0], TOLD[0]], logs, tmp_path / "run", Processes(2), second_target="expected")
    for name in ("BL-DC", "top"):
        for file in (SUMS_FILE, EXPECTED_FILE):
            one, other = (read_sums(folder_of(each, name), "iou", "all", file=file) for each in (out, tmp_path / "run"))
            np.testing.assert_array_equal(one, other)


def test_a_run_goes_on_where_it_was_and_finds_what_it_worked_out(out, logs):
    before = {path: path.stat().st_mtime_ns for path in out.parent.rglob("*.npz")}
    run([*PLAIN, *TOLD, SAME, MOVED], logs, out, second_target="expected")
    assert {path: path.stat().st_mtime_ns for path in out.parent.rglob("*.npz")} == before


def test_nothing_is_worked_out_for_rows_that_are_done(out, logs, tmp_path):
    for name in ("run", "run.yaml", "grids"):
        copy = shutil.copytree if (out.parent / name).is_dir() else shutil.copyfile
        copy(out.parent / name, tmp_path / name)
    for kept in (tmp_path / "grids").glob("*-truth-*.npz"):
        kept.unlink()
    rows, grids = [*PLAIN, *TOLD, SAME, MOVED], tmp_path / "grids"
    run(rows, logs, tmp_path / "run", second_target="expected")
    assert not list(grids.glob("*-truth-*.npz"))
    (folder_of(tmp_path / "run", "moved") / SUMS_FILE).unlink()
    run(rows, logs, tmp_path / "run", second_target="expected")
    assert len(list(grids.glob("*-truth-*.npz"))) == 4, "of two logs, what one row asks and its second target"


def test_results_name_the_versions_that_their_truth_depends_on(out):
    config = results.read_result(folder_of(out, "BL-DC")).config
    assert config["truth"] == [TRUTH_VERSION, FORMAT_VERSION]


def test_windows_carry_the_truth_for_who_asks_alone(logs, tmp_path, monkeypatch):
    seen: dict[str, bool] = {}
    batch = WindowSet.batch

    def noted(self, chosen):
        found = batch(self, chosen)
        seen[current[0]] = seen.get(current[0], False) or found.truth is not None
        return found

    monkeypatch.setattr(WindowSet, "batch", noted)
    for row in ({"name": "ED-DC", "model": "ed"}, *PLAIN, *TOLD):
        current = [row["name"]]
        run([row], logs, tmp_path / row["name"])
    assert seen == {"ED-DC": False, "BL-DC": False, "BL-Fuse": False, "top": True, "new": True}


def test_no_network_and_no_baseline_asks_for_the_truth():
    given = Given(("full",), 2, 128, 128, 100 / 128, translate=True)
    needed = {"log": {"folder": "predictions"}}
    settings = {name: find_model(name).parse_settings(needed.get(name, {})) for name in MODELS}
    asking = {name for name in MODELS if find_model(name).asks(settings[name], given) is not None}
    assert asking == {"ceiling", "fresh", "true_motion"}
    assert not any(issubclass(find_model(name), Network) or find_model(name).baseline for name in asking)


def test_answers_stand_at_their_windows_whatever_the_order_of_logs(logs, tmp_path):
    from semgrid_eval.executors import InProcess
    from semgrid_eval.progress import silent_stage
    from semgrid_eval.windows.plan import WindowConfig

    row = Row(name="x", model="newest", window=WindowConfig(step_frames=3, target_frame=8))
    data = RunData(logs, tmp_path, [row], executor=InProcess(), device=torch.device("cpu"), stage=silent_stage)
    grids = data.data(row.grid, "val")
    windows = planned((1, (2, 5), 8), (0, (2, 5), 8), (1, (1, 4), 7))
    orders = (np.array([0, 1, 2]), np.array([2, 0, 1]))
    chosen = [select_windows(grids, windows[order], sensors=("full",)) for order in orders]
    one, other = (told(Draws(2, continued=True), each, row.grid, tmp_path) for each in chosen)
    assert torch.equal(one[[2, 0, 1]], other)
    assert not torch.equal(one[0], one[1])
    assert replace(chosen[0], truth=one).batch(slice(1, 2)).truth.shape == (1, 10, 128, 128)


def test_each_log_is_asked_once_of_all_its_windows_in_their_order():
    """Two stretches of the log `a` lie on both sides of `b`, no window is of `c`, and windows come in any order."""
    logs = ("a.mcap", "b.mcap", "a.mcap", "c.mcap")
    recordings = [replace(random_recording(i, frames=9, size=8), log=log, digest=log) for i, log in enumerate(logs)]
    data = stack_recordings(recordings, cell_m=1.0)
    places = [(2, 5), (0, 8), (1, 4), (0, 3), (2, 7)]
    found = planned(*((owner, (frame - 1,), frame) for owner, frame in places))
    windows = select_windows(data, found, sensors=("full",))
    parts = list(parts_of(Draws(2, continued=True), windows, GridConfig()))
    assert [(str(part.question.log), part.windows.tolist()) for part in parts] == [
        ("a.mcap", [0, 1, 3, 4]),
        ("b.mcap", [2]),
    ]
    for part in parts:
        assert part.question.digest == str(part.question.log)
        expected = [data.stamps_ns[data.first_frames[places[i][0]] + places[i][1]] for i in part.windows]
        assert part.question.times.target_ns.tolist() == expected
