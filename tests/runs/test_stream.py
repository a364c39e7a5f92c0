"""Rows with a stream in a run: kept, told apart from plain rows, reported; and what they refuse."""

import csv
import json

import numpy as np
import pytest
from support.small_runs import run

from semgrid_eval.errors import ConfigError
from semgrid_eval.executors import Processes
from semgrid_eval.report.page.write import write_report
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums

STILL = {"name": "still", "model": "newest", "stream": {"latency_ms": 100, "move": False}}
ROWS = [
    {"name": "BL-DC", "model": "newest"},
    STILL,
    *(
        {"name": f"{name}+{added}", "model": model, "stream": {"latency_ms": 60, "asked": asked, "added_ms": added}}
        for added in (0.0, 120.0)
        for name, model, asked in (("newest", "newest", "capture"), ("fuse", "fuse", "known"))
    ),
    {"name": "table", "model": "table", "stream": {"latency_ms": 60, "asked": "fixed"}},
    *(
        {
            "name": f"flow for {lead}",
            "model": "flow",
            "window": {"lead_ms": lead, "target_frame": None},
            "stream": {"latency_ms": 60, "asked": "fixed"},
        }
        for lead in (59.0, 177.0)
    ),
]


@pytest.fixture(scope="module", name="done")
def done_fixture(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "run"
    record = run(ROWS, logs, out)
    assert {row.name: row.failure for row in record.rows} == dict.fromkeys(row["name"] for row in ROWS)
    return out, {row.name: results.read_result(results.result_folder(out, row.results[0])) for row in record.rows}


def test_streams_share_their_targets_with_each_other_and_not_with_plain_rows(done):
    _, found = done
    streams = {name: result for name, result in found.items() if name != "BL-DC"}
    assert len({result.targets for result in streams.values()}) == 1
    assert found["BL-DC"].targets != streams["still"].targets
    assert found["BL-DC"].stream is None
    assert len({result.id for result in found.values()}) == len(ROWS)


def test_a_stream_says_how_it_went(done):
    _, found = done
    late = found["newest+120.0"].stream
    assert late.latency_ms == 180
    assert late.age_ms >= 180
    assert 0 < late.misses < late.evaluations
    assert found["fuse+0.0"].stream.lead_ms > found["newest+0.0"].stream.lead_ms == 0
    # A fixed lead in ms is the nearest number of frames.
    assert found["flow for 177.0"].stream.lead_ms == pytest.approx(3 * found["flow for 59.0"].stream.lead_ms, rel=1e-3)


def test_what_is_later_is_worse_and_moving_along_is_better(done):
    out, found = done

    def right(name):
        counts = read_sums(results.result_folder(out, found[name].id), "iou", "all").sum(axis=(0, 1))
        return np.trace(counts) / counts.sum()

    assert right("newest+0.0") > right("newest+120.0")
    assert right("newest+0.0") >= right("still")


def test_a_second_run_finds_everything(done, logs):
    out, found = done
    again = run(ROWS, logs, out)
    assert {row.results[0] for row in again.rows} == {result.id for result in found.values()}


@pytest.mark.slow
def test_the_page_shows_strategies_and_the_best_lead_can_be_taken(done, tmp_path):
    out, _ = done
    page = write_report(out, tmp_path / "report").read_text()
    assert page.count('id="table-streams"') == page.count('id="table-stream-wins"') == 1
    with (tmp_path / "report" / "streams.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert {line["strategy"] for line in lines} >= {"still", "newest", "fuse", "table"}
    assert [line["added_ms"] for line in lines if line["strategy"] == "newest"] == ["0.000000", "120.000000"]
    shown = json.loads((tmp_path / "report" / "tables" / "categories.json").read_text())
    assert "newest+0.0" in str(shown)
    assert "newest+120.0" not in str(shown), "rows that are only later have their own section"
    leads = json.loads((tmp_path / "report" / "leads.json").read_text())["lead_ms"]
    assert leads["mean_known"] in (59.0, 177.0)
    taken = tmp_path / "taken.yaml"
    row = {"name": "taken", "model": "flow", "window": {"lead_ms": f"from {tmp_path}/report/leads.json"}}
    taken.write_text(json.dumps({"rows": [row]}))
    assert load_matrix(str(taken)).rows[0].window.lead_ms == leads["mean_known"]


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"stream": {}}, "give one of latency_ms, profile and recorded"),
        ({"stream": {"latency_ms": 1, "profile": "p.json"}}, "give one of latency_ms, profile and recorded"),
        ({"stream": {"latency_ms": -1}}, "latency_ms"),
        ({"stream": {"latency_ms": 1, "scale": 2}}, "scale and profile_model belong to a profile"),
        ({"stream": {"latency_ms": 1, "workers": "many", "rule": "shrinking_tail"}}, "one worker waits"),
        ({"stream": {"latency_ms": 1}, "disturb": {"kind": "lost_frame"}}, "neither disturbed inputs"),
        ({"stream": {"latency_ms": 1}, "second_target": "expected"}, "neither disturbed inputs nor a second target"),
        ({"model": "ceiling", "stream": {"latency_ms": 1}}, "answers for each time of evaluation: exact"),
        ({"model": "ed", "stream": {"latency_ms": 1, "asked": "known"}}, "needs a model that answers any lead"),
        ({"model": "residual-town", "stream": {"latency_ms": 1}}, "capture is for what predicts nothing"),
        (
            {"model": "residual-town", "window": {"lead_ms": 2000}, "stream": {"latency_ms": 1, "asked": "fixed"}},
            "2000 is not one of the leads that residual-town answers, 59 to 1250 ms",
        ),
        ({"stream": {"latency_ms": 1, "model_is_free": True}}, "model_is_free: give a profile"),
        (
            {"stream": {"profile": "p.json", "profile_model": "ed", "model_is_free": True}},
            "model_is_free: give a profile, and no profile_model",
        ),
        ({"stream": {"recorded": True}}, "is for model: log"),
        ({"window": {"lead_ms": 100, "horizon_steps": 2}}, "give one of lead_ms and horizon_steps"),
        ({"window": {"lead_ms": "from nowhere.json"}}, "nowhere.json"),
    ],
)
def test_what_cannot_be_meant_is_refused(changes, fault, tmp_path):
    path = tmp_path / "matrix.yaml"
    path.write_text(json.dumps({"rows": [{"name": "one", "model": "newest", **changes}]}))
    with pytest.raises(ConfigError, match=fault):
        load_matrix(str(path))


def test_a_profile_that_is_not_there_is_the_failure_of_its_row_alone(logs, tmp_path):
    rows = [
        {"name": "BL-DC", "model": "newest"},
        {"name": "late", "model": "newest", "stream": {"profile": "gone.json"}},
    ]
    record = run(rows, logs, tmp_path / "run")
    assert [row.failure is None for row in record.rows] == [True, False]
    assert "gone.json" in record.rows[1].failure


def test_latencies_of_a_profile_are_drawn_by_recording_and_a_model_that_it_lacks_is_named(logs, tmp_path):
    made_by = {"command": "test", "version": "0", "machine": {}}
    profile = {"format": 1, "made_by": made_by, "stages": {"grid": [50.0, 90.0]}, "models": {"newest": [10.0, 30.0]}}
    path = tmp_path / "latency.json"
    path.write_text(json.dumps(profile))
    rows = [
        {"name": "newest", "model": "newest", "stream": {"profile": str(path), "scale": 2, "added_ms": 5}},
        {"name": "other", "model": "newest", "stream": {"profile": str(path), "scale": 2, "added_ms": 5, "seed": 1}},
        {"name": "fuse", "model": "fuse", "stream": {"profile": str(path), "asked": "known"}},
        *(
            {"name": name, "model": "fuse", "stream": {"profile": str(path), "asked": "adaptive", **how}}
            for name, how in (("as newest", {"profile_model": "newest"}), ("free", {"model_is_free": True}))
        ),
    ]
    record = run(rows, logs, tmp_path / "run")
    first, other, as_newest, free = (
        results.read_result(results.result_folder(tmp_path / "run", row.results[0]))
        for row in record.rows
        if not row.failure
    )
    assert first.stream.latency_ms in (125.0, 185.0, 245.0)
    assert as_newest.stream.latency_ms in (60.0, 90.0, 120.0)
    assert free.stream.latency_ms in (50.0, 70.0, 90.0)
    assert first.id != other.id
    assert "latency.json" in record.rows[2].failure
    assert "model fuse: was not measured; the profile has: newest" in record.rows[2].failure
    path.write_text(json.dumps({**profile, "stages": {"grid": [50.0, 91.0]}}))
    again = run(rows, logs, tmp_path / "run")
    assert again.rows[0].results[0] != record.rows[0].results[0], "another profile, another result"


def test_a_stream_is_evaluated_as_often_as_it_says(logs, tmp_path):
    rows = [
        {"name": f"at {rate} Hz", "model": "newest", "stream": {"latency_ms": 60, "rate_hz": rate}} for rate in (2, 5)
    ]
    record = run(rows, logs, tmp_path / "run")
    found = [results.read_result(results.result_folder(tmp_path / "run", row.results[0])) for row in record.rows]
    assert [result.stream.evaluations for result in found] == [2, 6], "of two recordings of nine frames, .47 s"
    assert found[0].targets != found[1].targets, "what is evaluated at other times is not subtracted"
    write_report([tmp_path / "run"], tmp_path / "report")
    with (tmp_path / "report" / "streams.csv").open() as file:
        assert [line["evaluations"] for line in csv.DictReader(file)] == ["2", "6"]


@pytest.mark.slow
def test_two_processes_give_the_same_numbers_as_one(logs, tmp_path):
    profile = {
        "format": 1,
        "made_by": {"command": "test", "version": "0", "machine": {}},
        "stages": {"grid": [20.0, 90.0, 150.0]},
        "models": {"newest": [1.0, 2.0, 3.0], "fuse": [10.0, 20.0, 30.0]},
    }
    path = tmp_path / "latency.json"
    path.write_text(json.dumps(profile))
    rows = [
        {"name": "newest", "model": "newest", "stream": {"profile": str(path), "workers": "many"}},
        {"name": "fuse", "model": "fuse", "stream": {"profile": str(path), "asked": "adaptive"}},
    ]
    folders = [tmp_path / "alone" / "run", tmp_path / "together" / "run"]
    for folder, executor in zip(folders, (None, Processes(2, threads=1)), strict=True):
        folder.parent.mkdir()
        record = run(rows, logs, folder, executor)
        assert [row.failure for row in record.rows] == [None, None]
    for result_id in (row.results[0] for row in record.rows):
        sums = [read_sums(results.result_folder(folder, result_id), "iou", "all") for folder in folders]
        np.testing.assert_array_equal(*sums)
