from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_run import FakeRow, counted_row, make_fake_run
from support.scoring import score_rows

from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.page.provenance import failures
from semgrid_eval.report.page.summary import summarise, title_of
from semgrid_eval.report.rows.load import Run, load_runs
from semgrid_eval.report.rows.pairing import comparable, headline, reference_of, verdict
from semgrid_eval.scores.results import NOT_RUN

ROWS = (
    FakeRow("Table", "BL", learns=True),
    FakeRow("DC", "BL"),
    FakeRow("Fuse", "BL"),
    FakeRow("NT", "BL", translate=False),
    FakeRow("PH1", "BL", horizon_steps=2),
    FakeRow("fine", "BL", cell_m=0.5),
    FakeRow("DC", "ED", 0.05, 1),
    FakeRow("NT", "ED", 0.2, 1, translate=False),
    FakeRow("SL3", "ED", 0.2, 1, inputs=3),
    FakeRow("PH1", "ED", 0.2, 1, horizon_steps=2),
    FakeRow("PH2", "ED", 0.2, 1, horizon_steps=3),
    FakeRow("fine", "ED", 0.2, 1, cell_m=0.5),
    FakeRow("coarse", "ED", 0.2, 1, cell_m=2.0),
    FakeRow("mine", "BL", 0.2, 1, baseline=False),
)


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    run = make_fake_run(tmp_path_factory.mktemp("runs") / "run", rows=ROWS, recordings=3, windows=1)
    return load_runs([run])[0].rows


@pytest.mark.parametrize(
    ("name", "reference"),
    [
        ("ED-DC", "BL-DC"),
        ("ED-NT", "BL-NT"),
        ("ED-SL3", "BL-DC"),
        ("ED-PH1", "BL-PH1"),
        ("ED-PH2", None),
        ("BL-DC", None),
        ("BL-mine", "BL-DC"),
        ("ED-fine", "BL-fine"),
        ("ED-coarse", None),
    ],
)
def test_a_row_is_measured_against_the_baseline_of_its_question(rows, name, reference):
    row = next(row for row in rows if row.name == name)
    found = reference_of(row, rows)
    assert (found.name if found else None) == reference


def test_the_headline_compares_rows_of_one_question_only(rows):
    found = headline(score_rows(rows, np.random.default_rng(0), draws=2))
    assert found.best.record.facts.horizon_steps == 1
    assert found.compared == 5
    assert found.rival.is_baseline != found.best.is_baseline


def test_nothing_scored_has_no_headline():
    assert headline({}) is None


@pytest.mark.parametrize(
    ("estimate", "word"),
    [
        (Estimate(0.1, 0.01, 0.2), "gain"),
        (Estimate(-0.1, -0.2, -0.01), "loss"),
        (Estimate(0.1, -0.01, 0.2), "open"),
        (Estimate(0.1, np.nan, np.nan), "open"),
    ],
)
def test_a_difference_is_decided_only_where_the_interval_excludes_zero(estimate, word):
    assert verdict(estimate) == word


def test_the_summary_says_who_leads_by_how_much_and_on_what_it_rests(run):
    runs = load_runs([run])
    scores = score_rows(runs[0].rows, np.random.default_rng(0))
    found = headline(scores)
    summary = summarise(runs, scores, found)
    lead = scores["ED-DC"].mean["mean_known"] - scores["BL-Fuse"].mean["mean_known"]
    assert summary.sentences[0].startswith(
        "Like for like (2 inputs, sensor front, 0.29 s ahead; 3 rows), <strong>ED-DC</strong> has the highest mean"
    )
    assert f"+{lead:.3f} over BL-Fuse, the best baseline, clearly better (95% interval +" in summary.sentences[0]
    assert summary.sentences[1] == "It is also the best of all 6 rows with these targets."
    assert "16 windows from 8 recordings" in summary.sentences[2]
    assert "1 row failed" in summary.sentences[2]
    assert "With so few recordings the intervals are rough." in summary.sentences[2]
    assert summary.sentences[2].endswith("Intervals of rows with 2 seeds leave out much of the chance in training.")
    assert summary.compared == "ED-DC \N{MINUS SIGN} BL-Fuse"
    assert (summary.tiles[0].label, summary.tiles[0].value) == ("Mean (known)", f"+{lead:.3f}")
    assert all(0 <= tile.low <= tile.at <= tile.high <= 100 for tile in summary.tiles)


def test_rows_that_were_not_run_have_not_failed(run):
    (found,) = load_runs([run])
    left = tuple(
        replace(row, results=(), failures=(), record=row.record.model_copy(update={"results": (), "failure": NOT_RUN}))
        for row in found.rows[:2]
    )
    found = replace(found, rows=(*left, *found.rows[2:]))
    scores = score_rows(found.rows, np.random.default_rng(0))
    assert "; 1 row failed, 2 were not run yet." in summarise([found], scores, headline(scores)).sentences[2]
    assert [failure.name for failure in failures([found]) if failure.kind == "row"] == ["ED-NT"]


def test_what_is_nowhere_is_not_compared():
    rows = [counted_row(name, {"road": [hits] * 12}) for name, hits in (("BL-DC", 50), ("ED-DC", 60))]
    scores = score_rows(rows, np.random.default_rng(0))
    summary = summarise([Run(Path(), "", None, tuple(rows))], scores, headline(scores))
    words = {tile.label: (tile.value, tile.word) for tile in summary.tiles}
    assert words["Static (known)"] == ("+0.100", "clearly better")
    assert words["Vehicles"] == ("\N{EN DASH}", "absent")


def test_the_next_best_row_is_named_beside_the_best_of_the_other_kind():
    hits = {"BL-DC": 50, "BL-Fuse": 60, "BL-Flow": 59, "ED-DC": 30}
    rows = [counted_row(name, {"road": [number] * 12}) for name, number in hits.items()]
    scores = score_rows(rows, np.random.default_rng(0))
    (sentence, *_), compared = _said(rows, scores)
    first, second = sentence.split(", and ")
    assert "+0.010 over BL-Flow, the next best, clearly better" in first
    assert second.startswith("+0.300 over ED-DC, the best model that is not a baseline, clearly better")
    assert compared == "BL-Fuse \N{MINUS SIGN} ED-DC"


def test_a_lead_that_rounds_to_nothing_is_none():
    rows = [counted_row(name, {"road": [60] * 12}) for name in ("BL-Fuse", "BL-Flow")]
    scores = score_rows(rows, np.random.default_rng(0))
    assert ": as high as BL-Flow, the next best (95% interval 0.000 to 0.000)." in _said(rows, scores)[0][0]


def _said(rows, scores):
    summary = summarise([Run(Path(), "", None, tuple(rows))], scores, headline(scores))
    return summary.sentences, summary.compared


def test_a_difference_without_interval_may_be_chance():
    rows = [counted_row(name, {"road": [hits]}) for name, hits in (("BL-DC", 50), ("ED-DC", 60))]
    scores = score_rows(rows, np.random.default_rng(0))
    summary = summarise([Run(Path(), "", None, tuple(rows))], scores, headline(scores))
    assert summary.sentences[0].endswith("over BL-DC, the best baseline, which may be chance (no interval).")
    assert summary.sentences[1].endswith("With fewer than two recordings there are no intervals.")
    words = {tile.label: (tile.note, tile.word) for tile in summary.tiles}
    assert words["Static (known)"] == ("no interval", "may be chance")
    assert words["Vehicles"] == ("", "absent")


def test_only_rows_with_as_many_inputs_are_compared_first():
    more = counted_row("ED-SL5", {"road": [90] * 12})
    facts = more.record.facts.model_copy(update={"inputs": 5})
    more = replace(more, record=more.record.model_copy(update={"facts": facts}))
    rows = [counted_row("BL-DC", {"road": [50] * 12}), counted_row("ED-DC", {"road": [60] * 12}), more]
    scores = score_rows(rows, np.random.default_rng(0))
    found = headline(scores)
    assert (found.best.name, found.rival.name, found.compared) == ("ED-DC", "BL-DC", 2)
    assert (found.overall.name, found.sharing) == ("ED-SL5", 3)
    said = summarise([Run(Path(), "", None, tuple(rows))], scores, found).sentences[1]
    assert said.startswith(
        "Of all 3 rows with these targets, <strong>ED-SL5</strong> is best, 0.900: +0.300 over ED-DC, "
    )
    assert said.endswith("It differs in what it is given or asked: 5 inputs instead of 2 inputs.")


def test_rows_are_compared_only_with_the_same_targets_in_whichever_run(rows, tmp_path):
    by_name = {row.name: row for row in rows}
    assert comparable(by_name["ED-DC"], by_name["BL-PH1"])
    assert not comparable(by_name["ED-fine"], by_name["BL-DC"])
    other = make_fake_run(tmp_path / "other", rows=ROWS[1:2], recordings=3, windows=1)
    fewer = make_fake_run(tmp_path / "fewer", rows=ROWS[1:2], recordings=2, windows=1)
    assert comparable(by_name["BL-DC"], load_runs([other])[0].rows[0])
    assert not comparable(by_name["BL-DC"], load_runs([fewer])[0].rows[0])


def test_a_baseline_of_another_run_is_taken_only_where_the_own_one_has_none(rows, tmp_path):
    other = make_fake_run(tmp_path / "other", rows=(ROWS[1], ROWS[6]), recordings=3, windows=1)
    mine = load_runs([other])[0].rows
    assert reference_of(mine[1], [*rows, *mine]) is mine[0]
    assert reference_of(mine[1], [*rows, mine[1]]).name == "BL-DC"


def test_a_title_tells_runs_apart_in_front(tmp_path):
    runs = [
        make_fake_run(tmp_path / name, rows=ROWS[:1], recordings=1, title=title)
        for name, title in (("first", "Town"), ("other", "Town"), ("third", "City"))
    ]
    assert title_of(load_runs(runs[:1])) == "Town"
    assert title_of(load_runs(runs[:2])) == "first and other: Town"
    assert title_of(load_runs(runs[1:])) == "other: Town; third: City"


def test_a_row_without_a_result_can_be_compared_with_none(rows):
    left = replace(rows[0], results=())
    assert not comparable(left, left)
