"""Predictions made elsewhere: a row's own come back to the count, plain and streaming; what is wrong is one line."""

import shutil

import numpy as np
import pytest
from support.small_runs import run
from support.toy_world import FRAME_NS, START_NS

import semgrid_eval as sg
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.playback.export import export_predictions, write_predictions
from semgrid_eval.playback.write import Play, write_playback
from semgrid_eval.runs.row import Row
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums

ALL = {"step_frames": 2, "target_frame": None}
RECORDINGS = ("toy_000002_000000", "toy_000003_000000")
LATE_MS = 2 * FRAME_NS / 1e6


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
    export_predictions(out, "table", logs / ".." / "plain")
    export_predictions(out, "table", logs / ".." / "late", latency_ms=LATE_MS)
    return out.parent


def record_of(out, name):
    row = next(row for row in results.read_run(out).rows if row.name == name)
    assert row.failure is None
    return results.read_result(results.result_folder(out, row.results[0]))


def sums_of(out, name):
    return {
        key: read_sums(results.result_folder(out, record_of(out, name).id), *key)
        for key in (("iou", "all"), ("iou", "distance"), ("calibration", "all"))
    }


def logged(folder, **more):
    given = {key: value for key, value in more.items() if value is not None}
    return {"name": "logged", "model": "log", "settings": {"folder": str(folder)}, **given}


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


def test_a_played_log_is_a_log_of_predictions(exported, logs, tmp_path):
    folder = tmp_path / "played"
    folder.mkdir()
    names = dict.fromkeys(window.recording for window in record_of(exported / "made", "table").windows)
    for number, name in enumerate(names):
        write_playback(Play(exported / "made", ("table",), recording=name), folder / f"{number}.mcap")
    run([logged(folder)], logs, tmp_path / "out", window=ALL)
    expected, found = sums_of(exported / "made", "table"), sums_of(tmp_path / "out", "logged")
    for key, counted in expected.items():
        np.testing.assert_array_equal(found[key], counted)


def test_results_depend_on_what_the_logs_hold_and_not_on_other_recordings(exported, logs, tmp_path):
    folder, ids = tmp_path / "predictions", []
    for number, what in enumerate(("table", "table", "newest")):
        shutil.rmtree(folder, ignore_errors=True)
        export_predictions(exported / "made", what, folder)
        write_predictions(folder / "more.mcap", [prediction(0, capture_ns=number)], recording=f"other {number}")
        run([logged(folder)], logs, tmp_path / "out", window=ALL)
        ids.append(record_of(tmp_path / "out", "logged").id)
    assert ids[0] == ids[1] != ids[2]
    expected, found = sums_of(exported / "made", "newest"), sums_of(tmp_path / "out", "logged")
    np.testing.assert_array_equal(found["iou", "all"], expected["iou", "all"])


def prediction(value, *, capture_ns, for_ns=None, publish_ns=None):
    """A grid of one class, by default for its capture and published then."""
    times = (capture_ns if for_ns is None else for_ns, capture_ns, capture_ns if publish_ns is None else publish_ns)
    return sg.Prediction(np.full((128, 128), value, np.uint8), *times)


def at(frame):
    return START_NS + frame * FRAME_NS


def write_all(folder, predictions):
    """Write the same predictions for both recordings that are scored."""
    for name in RECORDINGS:
        write_predictions(folder / f"{name}.mcap", predictions, recording=name)
    return folder


def test_of_predictions_for_a_windows_target_the_newest_by_its_inputs_is_taken(logs, tmp_path):
    """The target is frame 8, the newest input frame 6; half a period is 29 ms."""
    near_ns = at(8) + 25_000_000
    made = [
        prediction(1, capture_ns=at(4), for_ns=at(8)),
        prediction(2, capture_ns=at(5), for_ns=at(8)),
        prediction(3, capture_ns=at(6) - 1, for_ns=near_ns),
        prediction(4, capture_ns=at(6), for_ns=at(7)),
        prediction(5, capture_ns=at(6) + 1, for_ns=at(8)),
    ]
    run([logged(write_all(tmp_path / "made", made))], logs, tmp_path / "out", window={**ALL, "target_frame": 8})
    counts = sums_of(tmp_path / "out", "logged")["iou", "all"][:, 0].sum(axis=0)
    assert np.flatnonzero(counts.sum(axis=0)).tolist() == [3]


def test_a_stream_takes_what_is_published_moves_it_from_where_it_is_for_and_adds_a_delay(logs, tmp_path):
    """Answers of classes 1 to 3 with captures 2, 3, 1 are there at 4, 5, 6: the last is older and is never used."""
    made = [
        prediction(value, capture_ns=at(frame), for_ns=at(later), publish_ns=at(published))
        for value, frame, later, published in ((1, 2, 4, 4), (2, 3, 5, 5), (3, 1, 6, 6))
    ]
    folder = write_all(tmp_path / "made", made)
    rows = [
        logged(folder, name=f"{added}", stream={"recorded": True, "move": False, "added_ms": added * FRAME_NS / 1e6})
        for added in (0, 2)
    ]
    run(rows, logs, tmp_path / "out", window=ALL)
    for added, used in ((0, [0] * 4 + [1] + [2] * 4), (2, [0] * 6 + [1] + [2] * 2)):
        record = record_of(tmp_path / "out", f"{added}")
        assert (record.stream.misses, record.stream.answers) == (2 * used.count(0), 2 * 3)
        assert record.stream.first_answer_ms == pytest.approx((4 + added) * FRAME_NS / 1e6, abs=1e-3)
        counts = sums_of(tmp_path / "out", f"{added}")["iou", "all"][:, 0].sum(axis=0)
        shares = counts.sum(axis=0) / counts.sum()
        np.testing.assert_allclose(shares[[0, 1, 2]], np.bincount(used) / 9, atol=0.03)  # cells of M differ
        assert counts[:, 3:].sum() == 0


def failure(rows, logs, out, **window):
    return run(rows, logs, out, window={**ALL, **window}).rows[0].failure


def test_missing_times_and_logs_are_named(exported, logs, tmp_path):
    folder = tmp_path / "made"
    shutil.copytree(exported / "plain", folder)
    wrong = failure([logged(folder)], logs, tmp_path / "out", horizon_steps=2)
    first = (
        f"{folder}/{RECORDINGS[0]}.mcap: recording {RECORDINGS[0]}: nothing for {at(6)} ns by inputs up to {at(2)} ns"
    )
    assert wrong == f"{first}; in all, 6 of 6 windows miss theirs"
    (folder / f"{RECORDINGS[1]}.mcap").unlink()
    wrong = failure([logged(folder)], logs, tmp_path / "out")
    assert wrong == f"{folder}: no log of predictions belongs to the recording {RECORDINGS[1]}"
    shutil.copy(folder / f"{RECORDINGS[0]}.mcap", folder / "twice.mcap")
    wrong = failure([logged(folder)], logs, tmp_path / "out")
    assert wrong == f"{folder}: {RECORDINGS[0]}.mcap and twice.mcap both belong to {RECORDINGS[0]}"
    assert failure([logged(tmp_path / "nope")], logs, tmp_path / "out") == f"{tmp_path}/nope: is not a folder"


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"capture_ns": at(-1)}, "capture_time"),
        ({"capture_ns": at(9)}, "capture_time"),
        ({"capture_ns": at(2), "for_ns": at(-1)}, "timestamp"),
        ({"capture_ns": at(2), "for_ns": at(8) + 60_000_000_001}, "timestamp"),
    ],
)
@pytest.mark.parametrize("stream", [None, {"recorded": True}])
def test_predictions_of_times_that_no_truth_covers_are_refused(logs, tmp_path, wrong, field, stream):
    folder = write_all(tmp_path / "made", [prediction(1, **wrong)])
    reason = failure([logged(folder, stream=stream)], logs, tmp_path / "out")
    value = wrong["for_ns" if field == "timestamp" else "capture_ns"]
    reach = f"the recording goes from {at(0)} to {at(8)} ns"
    assert reason == f"{folder}/{RECORDINGS[0]}.mcap: {field}: {value} ns, where no truth is: {reach}"


def test_another_grid_is_refused(exported, logs, tmp_path):
    folder = exported / "plain"
    grid = {"spec": {"cell_m": 0.5}}
    reason = run([logged(folder, grid=grid)], logs, tmp_path / "out", window=ALL).rows[0].failure
    assert reason.startswith(f"{folder}/{RECORDINGS[0]}.mcap: /grid/prediction/exact at {at(2)} ns: ")
    assert reason.endswith("cell_size_m: 0.78125 m, and 0.5 m is scored")


@pytest.mark.parametrize(
    ("row", "fault"),
    [
        ({"stream": {"latency_ms": 100}}, "stream.recorded: true is for model: log"),
        ({"model": "newest", "settings": {}, "stream": {"recorded": True}}, "stream.recorded: true is for model: log"),
        ({"stream": {"recorded": True, "latency_ms": 1}}, "give one of latency_ms, profile and recorded: true"),
        (
            {"stream": {"recorded": True, "workers": "many"}},
            "recorded: workers, rule and asked are of what is",
        ),
        ({"disturb": {"kind": "lost_frame"}}, "disturb: answers that were made elsewhere have no inputs to disturb"),
        ({"settings": {}}, "settings.folder"),
        ({"settings": {"folder": "x", "folders": 1}}, "folders"),
    ],
)
def test_what_a_row_cannot_mean_is_refused_before_anything_is_read(row, fault):
    with pytest.raises(ConfigError, match=fault):
        parse_config(Row, {**logged("x"), **row}, path="row")


def test_what_is_published_long_after_is_never_there_however_much_is_added(logs, tmp_path):
    late = prediction(1, capture_ns=at(2), publish_ns=(1 << 63) - 1)
    row = logged(write_all(tmp_path / "made", [late]), stream={"recorded": True, "added_ms": 60_000})
    run([row], logs, tmp_path / "out", window=ALL)
    assert record_of(tmp_path / "out", "logged").stream.misses == 2 * 9


def test_labels_say_where_answers_are_from_and_nothing_of_inputs():
    rows = [parse_config(Row, logged("x", stream=stream), path="row") for stream in (None, {"recorded": True})]
    assert [row.label for row in rows] == [
        "logged (predictions of x, 1 step of 5 frames ahead)",
        "logged (predictions of x, published as recorded, moved along with the vehicle)",
    ]


OWN = """
from semgrid_eval.models.recorded import Recorded

class Mine(Recorded):
    files = ()
    def predict(self, batch):
        return super().predict(batch).flip(dims=[-1])
"""


def test_a_model_of_ones_own_is_given_answers_that_were_made_elsewhere(exported, logs, tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    rows = [
        logged(exported / "plain"),
        {**logged(exported / "plain", name="mine"), "model": f"{tmp_path}/mine.py:Mine"},
    ]
    run(rows, logs, tmp_path / "out", window=ALL)
    kept = {}
    for name in ("logged", "mine"):
        folder = results.result_folder(tmp_path / "out", record_of(tmp_path / "out", name).id)
        kept[name] = results.read_predictions(folder)
    for what in ("prediction", "certainty"):
        np.testing.assert_array_equal(kept["mine"][what], kept["logged"][what][..., ::-1])


def test_outside_a_run_there_are_no_answers(logs):
    windows = sg.make_windows(sg.build_grids(sg.find_logs(logs)[0]), sg.WindowConfig(step_frames=2, target_frame=None))
    with pytest.raises(InputError, match="its answers are in logs, which only `semgrid-eval run` reads"):
        sg.evaluate(sg.make_model("log", windows, {"folder": "x"}), windows)


def test_exports_refuse_what_they_cannot_write(exported, tmp_path):
    with pytest.raises(InputError, match="row stream: is a stream and has no windows"):
        export_predictions(exported / "made", "stream", tmp_path / "out")
    with pytest.raises(InputError, match="plain: exists and is not an empty folder"):
        export_predictions(exported / "made", "table", exported / "plain")
    with pytest.raises(InputError, match="latency_ms: -1 ms is not a latency"):
        export_predictions(exported / "made", "table", tmp_path / "out", latency_ms=-1)
