import dataclasses
import json
import re
from shutil import copytree

import numpy as np
import pytest
import torch
from support.small_runs import SPLITS, run
from support.toy_world import street

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.executors import Processes
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.types import Actor, Pose
from semgrid_eval.scores import results
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.sums import read_sums


def score(out, record, name):
    row = next(row for row in record.rows if row.name == name)
    assert row.failure is None, row.failure
    counts = read_sums(results.result_folder(out, row.results[0]), "iou", "all")[:, 0]
    return float(IOU.means(class_iou(counts.sum(axis=0)))["mean_known"])


def test_alignment_beats_none_and_a_reversed_motion_is_worse_than_both(tmp_path):
    for name, direction in (("right", 1.0), ("reversed", -1.0)):
        for i in range(3):
            world = street(10 + i, frames=9, speed_mps=9, yaw_rate_radps=0.08 * (i - 1), noise_px=0.05)
            recording = world.recording(f"{name}_{i:06}_000000", direction=direction)
            write_log(recording, tmp_path / name / f"{name}{i}.mcap")
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "BL-NT", "model": "newest", "translate": False}]
    right = run(rows, tmp_path / "right", tmp_path / "run_right")
    wrong = run(rows, tmp_path / "reversed", tmp_path / "run_wrong")
    aligned, repeated = (score(tmp_path / "run_right", right, name) for name in ("BL-DC", "BL-NT"))
    reversed_motion = score(tmp_path / "run_wrong", wrong, "BL-DC")
    assert aligned > repeated + 0.02
    assert reversed_motion < repeated - 0.02


def test_a_run_leaves_results_that_parse_and_belong_together(logs, tmp_path):
    out = tmp_path / "run"
    rows = [
        {"name": "BL-DC", "model": "newest"},
        {"name": "BL-Fuse", "model": "fuse"},
        {"name": "BL-Sp2", "model": "overlay", "sensors": ["split2_upper", "split2_lower"]},
        {"name": "ED-Sp2", "model": "ed", "sensors": ["split2_upper", "split2_lower"]},
    ]
    record = run(rows, logs, out)
    assert [row.failure for row in record.rows] == [None] * 4
    assert results.read_run(out) == record
    assert {log.split for log in record.logs} == {"train", "val"}
    for row in record.rows:
        folder = results.result_folder(out, row.results[0])
        result = results.read_result(folder)
        assert [window.recording for window in result.windows] == ["toy_000002_000000", "toy_000003_000000"]
        assert {window.target_frame for window in result.windows} == {8}
        windows = results.read_windows(out, result.windows_id)
        assert windows["inputs"].shape == (2, len(row.facts.sensors), 2, 128, 128)
        predictions = results.read_predictions(folder)
        counts = read_sums(folder, "iou", "all")[:, 0]
        for n in range(2):
            scored = ~windows["mask"][n]
            for class_id in range(len(CLASS_NAMES)):
                target = windows["target"][n][scored] == class_id
                predicted = predictions["prediction"][n][scored] == class_id
                assert counts[n, class_id, class_id] == (target & predicted).sum()
                assert counts[n, class_id].sum() == target.sum()
    history = results.read_history(results.result_folder(out, record.rows[3].results[0]))
    assert list(history["epoch"]) == [1, 2]
    assert history["validation_loss"].notna().all()


def test_a_second_start_does_nothing_and_a_damaged_result_is_made_again_alike(logs, tmp_path, caplog):
    out = tmp_path / "run"
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "ED-DC", "model": "ed"}]
    record = run(rows, logs, out)
    folder = results.result_folder(out, record.rows[1].results[0])
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file() and path.name != "run.json"}
    run(rows, logs, out)
    assert before == {path: path.stat().st_mtime_ns for path in before}
    counts, text = (folder / "sums.npz").read_bytes(), json.loads((folder / "result.json").read_text())
    (folder / "sums.npz").write_bytes(counts[:100])
    assert caplog.messages == []
    run(rows, logs, out)
    assert caplog.messages == [
        f"{folder}/sums.npz: is damaged, or of another version: it has no seal; the result is made again"
    ]
    assert (folder / "sums.npz").read_bytes() == counts
    again = json.loads((folder / "result.json").read_text())
    for record in (text, again):
        del record["predict_seconds"], record["seal"]
    assert text == again


def test_rows_that_mean_the_same_share_training_and_result(logs, tmp_path):
    rows = [{"name": "ED-DC", "model": "ed", "repeats": 2}, {"name": "ED-SL2", "model": "ed", "repeats": 2}]
    record = run(rows, logs, tmp_path / "run")
    assert record.rows[0].results == record.rows[1].results
    assert len(set(record.rows[0].results)) == 2
    assert len(list((tmp_path / "run" / "trainings").iterdir())) == 2


def test_a_row_that_fails_is_noted_and_the_others_go_on(logs, tmp_path):
    rows = [
        {"name": "ED-far", "model": "ed", "window": {"horizon_steps": 9, "target_frame": 100}},
        {"name": "BL-none", "model": "newest", "validation_split": "test"},
        {"name": "own", "model": f"{tmp_path}/missing.py:Model"},
        {"name": "BL-DC", "model": "newest"},
    ]
    record = run(rows, logs, tmp_path / "run")
    reasons = {row.name: row.failure for row in record.rows}
    assert "9" in reasons["ED-far"]
    assert reasons["BL-none"] == "no recording of split 'test' gave grids (splits found: train, val)"
    assert re.search(r"missing\.py: is not there", reasons["own"])
    assert reasons["BL-DC"] is None
    assert results.read_run(tmp_path / "run") == record


def test_a_counted_table_is_told_apart_by_what_it_was_counted_on(logs, tmp_path):
    rows = [
        {"name": "BL-Table", "model": "table"},
        {"name": "BL-Table-val", "model": "table", "train_split": "val"},
        {"name": "BL-none", "model": "table", "train_split": "test"},
        {"name": "BL-Flow", "model": "flow"},
        {"name": "BL-Flow-lax", "model": "flow", "settings": {"overlap": 0.1}},
        {"name": "BL-Fuse", "model": "fuse"},
    ]
    record = run(rows, logs, tmp_path / "run")
    found = {row.name: row.results for row in record.rows}
    assert found.pop("BL-none") == ()
    assert len(set(found.values())) == 5
    fewer = tmp_path / "fewer"
    for log in sorted(logs.rglob("*.mcap"))[1:]:  # without the first training log
        (fewer / log.parent.name).mkdir(parents=True, exist_ok=True)
        (fewer / log.parent.name / log.name).hardlink_to(log)
    again = {row.name: row.results for row in run(rows, fewer, tmp_path / "again").rows}
    assert again["BL-Table"] != found["BL-Table"]
    assert all(again[name] == found[name] for name in ("BL-Table-val", "BL-Flow", "BL-Fuse"))
    assert score(tmp_path / "run", record, "BL-Table-val") != score(tmp_path / "run", record, "BL-Table")


def test_truth_in_the_logs_gives_scores_near_moving_and_standing_actors(tmp_path):
    for number, truth in enumerate((True, False)):
        recording = street(number, frames=9).recording(f"toy_{number:06}_000000")
        car = Actor(7, LABEL_ID["car"], 25.0, 0.0, 0.0, 4.4, 1.8, 1.5, 3.0, 0.0)
        parked = dataclasses.replace(car, actor_id=8, y_m=5.0, velocity_x_mps=0.0)
        known = {"pose": Pose(0, 0.0, 0.0, 0.0), "actors": (car, parked)} if truth else {}
        write_log(with_truth(recording, known), tmp_path / "logs" / f"toy{number}.mcap")
    record = run([{"name": "BL-DC", "model": "newest"}], tmp_path / "logs", tmp_path / "run")
    folder = results.result_folder(tmp_path / "run", record.rows[0].results[0])
    moving, standing = np.moveaxis(read_sums(folder, "iou", "actors"), 1, 0)
    for counts in (moving, standing):
        assert (counts.sum(axis=(1, 2)) > 0).tolist() == [True, False]
    windows_id = results.read_result(folder).windows_id
    kept = results.read_arrays(results.windows_file(tmp_path / "run", windows_id), ("actors", "mask"))
    near = (kept["actors"] == 1) & ~kept["mask"]
    assert standing.sum() == near.sum()


def with_truth(recording, known):
    """Give every moment the same truth, the vehicle standing in the map."""

    def moments():
        for moment in recording.moments():
            pose = {"pose": dataclasses.replace(known["pose"], stamp_ns=moment.stamp_ns)} if known else {}
            yield dataclasses.replace(moment, **{**known, **pose})

    return dataclasses.replace(recording, moments=moments)


def test_predictions_of_a_perfect_past_are_certain(logs, tmp_path):
    record = run([{"name": "BL-DC", "model": "newest"}], logs, tmp_path / "run")
    folder = results.result_folder(tmp_path / "run", record.rows[0].results[0])
    certainty = results.read_arrays(folder / "predictions.npz", ("certainty",))["certainty"]
    assert (np.asarray(certainty) == 255).all()


@pytest.mark.slow
def test_several_processes_give_the_same_bytes_as_one(logs, tmp_path):
    rows = [
        {"name": "BL-DC", "model": "newest"},
        {"name": "ED-DC", "model": "ed", "repeats": 2},
        {"name": "BL-none", "model": "newest", "validation_split": "test"},
    ]
    one = run(rows, logs, tmp_path / "one")
    several = run(rows, logs, tmp_path / "several", Processes(2, threads=torch.get_num_threads()))
    assert [(row.results, row.failure) for row in one.rows] == [(row.results, row.failure) for row in several.rows]
    for row in one.rows:
        for result_id in row.results:
            for name in ("sums.npz", "predictions.npz"):
                first, second = (results.result_folder(tmp_path / run, result_id) / name for run in ("one", "several"))
                assert first.exists() == second.exists()
                assert not first.exists() or first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize("mode", ["exclude", "substitute", "off"])
def test_mask_modes_differ_in_the_row_of_unknown_only(logs, tmp_path, mode):
    record = run([{"name": "BL-DC", "model": "newest", "mask_mode": mode}], logs, tmp_path / "run")
    folder = results.result_folder(tmp_path / "run", record.rows[0].results[0])
    counts = read_sums(folder, "iou", "all")[:, 0]
    windows_id = results.read_result(folder).windows_id
    windows = results.read_arrays(results.windows_file(tmp_path / "run", windows_id), ("mask", "target"))
    prediction = results.read_arrays(folder / "predictions.npz", ("prediction",))["prediction"]
    masked = windows["mask"].sum()
    assert masked > 100
    assert counts.sum() == windows["mask"].size - (masked if mode == "exclude" else 0)
    right_unknown = ((prediction == 0) & (windows["target"] == 0) & ~windows["mask"]).sum()
    seen_again = ((prediction == 0) & windows["mask"]).sum()
    expected = {"exclude": 0, "substitute": masked, "off": seen_again}[mode]
    assert counts[:, 0, 0].sum() == right_unknown + expected


@pytest.mark.parametrize(
    ("place", "others"), [("models.fitting.train", None), ("runs.data.stack_recordings", "out of memory: CUDA")]
)
def test_a_row_that_has_no_room_is_noted_and_the_others_go_on(logs, tmp_path, monkeypatch, place, others):
    def no_room(*_args, **_kwargs):
        raise torch.OutOfMemoryError("CUDA out of memory.\nTried to allocate 2 GiB")

    monkeypatch.setattr(f"semgrid_eval.{place}", no_room)
    rows = [{"name": "ED", "model": "ed"}, {"name": "BL", "model": "newest"}]
    record = run(rows, logs, tmp_path / "run")
    assert record.rows[0].failure == "out of memory: CUDA out of memory."
    assert str(record.rows[1].failure).startswith(str(others))
    assert run(rows, logs, tmp_path / "run", only=("ED",)).rows[0].failure == record.rows[0].failure


def test_two_logs_of_one_recording_are_refused(tmp_path):
    for name in ("a", "b"):
        write_log(street(1, frames=9).recording("twin"), tmp_path / "logs" / f"{name}.mcap")
    with pytest.raises(InputError, match=r"b\.mcap and a\.mcap both hold twin"):
        run([{"name": "BL-DC", "model": "newest"}], tmp_path / "logs", tmp_path / "run")


def test_whatever_a_result_has_lost_is_made_again(logs, tmp_path):
    out = tmp_path / "run"
    rows = [{"name": "ED-DC", "model": "ed"}]
    record = run(rows, logs, out)
    folder = results.result_folder(out, record.rows[0].results[0])
    windows = next((out / "windows").iterdir())
    kept = {path: path.read_bytes() for path in (windows, folder / "predictions.npz", folder / "history.csv")}
    windows.write_bytes(b"junk")
    (folder / "predictions.npz").unlink()
    (folder / "history.csv").write_text("")
    run(rows, logs, out)
    assert kept == {path: path.read_bytes() for path in kept}


def test_logs_too_short_for_a_window_are_named(logs, tmp_path):
    folder = tmp_path / "logs"
    write_log(street(1, frames=9).recording("long"), folder / "long.mcap")
    write_log(street(1, frames=5).recording("short"), folder / "short.mcap")
    record = run([{"name": "BL-DC", "model": "newest"}], folder, tmp_path / "run")
    assert record.rows[0].failure is None
    assert record.failed_logs == {"short.mcap": "short.mcap: has 5 frames, and a window needs 9"}


def test_where_no_log_has_what_a_row_looks_at_the_row_says_so_and_no_log_is_at_fault(logs, tmp_path):
    grid = {"sensors": {"top": {"kind": "lidar"}}, "target": ["top"]}
    rows = [{"name": "BL-DC", "model": "newest", "grid": grid}, {"name": "BL-Fuse", "model": "fuse"}]
    record = run(rows, logs, tmp_path / "run")
    reason = "train/toy0.mcap: lidar: the log has none"
    told = f"none of the logs ({len(SPLITS)}) gave grids; the first fails by: {reason}"
    assert [row.failure for row in record.rows] == [told, None]
    assert record.failed_logs == {}


def test_logs_to_train_on_are_left_alone_where_no_row_learns(logs, tmp_path):
    scored = {"name": "BL-DC", "model": "newest"}
    for rows, splits in (([scored], {"val"}), ([scored, {"name": "ED-DC", "model": "ed"}], {"train", "val"})):
        record = run(rows, logs, tmp_path / "run")
        assert {log.split for log in record.logs} == splits
        assert len(list((tmp_path / "grids").glob("*.npz"))) == len(record.logs)


def test_a_split_that_no_log_is_of_is_told_as_that_beside_a_log_that_is_damaged(logs, tmp_path):
    folder = tmp_path / "logs"
    copytree(logs, folder)
    (folder / "bad.mcap").write_bytes(b"no log")
    record = run([{"name": "BL-none", "model": "newest", "validation_split": "test"}], folder, tmp_path / "run")
    assert record.rows[0].failure == "no recording of split 'test' gave grids (splits found: train, val)"


def test_where_every_log_is_damaged_the_row_says_so_and_each_is_named(logs, tmp_path):
    whole = next((logs / "val").iterdir()).read_bytes()
    (tmp_path / "logs").mkdir()
    for name in ("a", "b"):
        (tmp_path / "logs" / f"{name}.mcap").write_bytes(whole[:5000])
    record = run([{"name": "BL-DC", "model": "newest"}], tmp_path / "logs", tmp_path / "run")
    assert record.rows[0].failure.startswith("none of the logs (2) gave grids; the first fails by: a.mcap: ")
    assert list(record.failed_logs) == ["a.mcap", "b.mcap"]


def test_a_damaged_log_is_named_by_its_place_and_the_others_are_scored(logs, tmp_path):
    folder = tmp_path / "logs"
    write_log(street(1, frames=9).recording("good"), folder / "val" / "good.mcap")
    (folder / "val" / "bad.mcap").write_bytes((folder / "val" / "good.mcap").read_bytes()[:5000])
    record = run([{"name": "BL-DC", "model": "newest"}], folder, tmp_path / "run")
    assert record.rows[0].failure is None
    assert list(record.failed_logs) == ["val/bad.mcap"]
    assert record.failed_logs["val/bad.mcap"].startswith("val/bad.mcap: ")
    assert str(tmp_path) not in str(record.failed_logs)


def test_one_row_alone_can_be_run_and_the_others_keep_what_they_have(logs, tmp_path):
    out = tmp_path / "run"
    rows = [{"name": name, "model": model} for name, model in (("BL-DC", "newest"), ("BL-Fuse", "fuse"), ("ED", "ed"))]
    first = run(rows, logs, out, only=("BL-DC",))
    assert [row.failure for row in first.rows] == [None, "not run yet", "not run yet"]
    second = run(rows, logs, out, only=("BL-Fuse",))
    assert [row.failure for row in second.rows] == [None, None, "not run yet"]
    assert second.rows[0].results == first.rows[0].results
    third = run(rows, logs, tmp_path / "third", only=("BL-*", "BL-DC"))
    assert [row.failure for row in third.rows] == [None, None, "not run yet"]
    with pytest.raises(ConfigError, match=r"row: 'BL-Fus' is not one of BL-DC, BL-Fuse, ED; did you mean BL-Fuse"):
        run(rows, logs, out, only=("BL-Fus",))
