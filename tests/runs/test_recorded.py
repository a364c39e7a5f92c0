"""Predictions made elsewhere: a row's own come back to the count, plain and streaming; what is wrong is one line."""

import numpy as np
import pytest
from support.small_runs import run, write_logs
from support.toy_world import FRAME_NS

from semgrid_eval.playback.export import export_row
from semgrid_eval.scores import results

ALL = {"step_frames": 2, "target_frame": None}
LATE_MS = 2 * FRAME_NS / 1e6


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return write_logs(tmp_path_factory.mktemp("logs"))


@pytest.fixture(scope="module")
def exported(logs):
    """A run of rows whose predictions are kept, two of them written as logs."""
    out = logs / ".." / "made"
    rows = [
        {"name": "table", "model": "table"},
        {"name": "newest", "model": "newest"},
        {
            "name": "stream",
            "model": "table",
            "stream": {"latency_ms": LATE_MS, "workers": "many", "asked": "fixed"},
        },
    ]
    run(rows, logs, out, window=ALL)
    export_row(out, "table", logs / ".." / "plain")
    export_row(out, "table", logs / ".." / "late", latency_ms=LATE_MS)
    return out.parent


def sums_of(out, name):
    row = next(row for row in results.read_run(out).rows if row.name == name)
    assert row.failure is None
    return {
        key: results.read_sums(results.result_folder(out, row.results[0]), *key)
        for key in (("iou", "all"), ("iou", "distance"), ("calibration", "all"))
    }


def logged(folder, **more):
    return {"name": "logged", "model": "log", "settings": {"folder": str(folder)}, **more}


def test_a_rows_predictions_read_back_from_logs_score_the_same_to_the_count(exported, logs, tmp_path):
    run([logged(exported / "plain")], logs, tmp_path / "out", window=ALL)
    expected, found = sums_of(exported / "made", "table"), sums_of(tmp_path / "out", "logged")
    for key, counted in expected.items():
        np.testing.assert_array_equal(found[key], counted)
    assert expected["iou", "all"].sum() > 0


def test_a_stream_of_recorded_answers_scores_as_the_simulated_one_to_the_count(exported, logs, tmp_path):
    run([logged(exported / "late", stream={"recorded": True})], logs, tmp_path / "out", window=ALL)
    expected, found = sums_of(exported / "made", "stream"), sums_of(tmp_path / "out", "logged")
    for key, counted in expected.items():
        np.testing.assert_array_equal(found[key], counted)
    assert np.trace(expected["iou", "all"][:, 0].sum(axis=0)) > 0
