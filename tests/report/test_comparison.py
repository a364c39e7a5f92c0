import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.report.comparison import headline, reference_of, verdict
from semgrid_eval.report.estimates import Estimate, score_rows
from semgrid_eval.report.reading import load_runs
from semgrid_eval.report.summary import summarise

ROWS = (
    FakeRow("Fuse", "BL"),
    FakeRow("DC", "BL"),
    FakeRow("NT", "BL", translate=False),
    FakeRow("PH1", "BL", horizon_steps=2),
    FakeRow("DC", "ED", 0.05, 1),
    FakeRow("NT", "ED", 0.2, 1, translate=False),
    FakeRow("SL3", "ED", 0.2, 1),
    FakeRow("PH1", "ED", 0.2, 1, horizon_steps=2),
    FakeRow("PH2", "ED", 0.2, 1, horizon_steps=3),
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
    ],
)
def test_a_row_is_measured_against_the_baseline_of_its_question(rows, name, reference):
    row = next(row for row in rows if row.name == name)
    found = reference_of(row, rows)
    assert (found.name if found else None) == reference


def test_the_headline_compares_rows_of_one_question_only(rows):
    found = headline(score_rows(rows, np.random.default_rng(0), draws=2))
    assert found.best.record.horizon_steps == 1
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
    assert summary.sentences[0].startswith("ED-DC has the highest mean class IoU, ")
    assert f"+{lead:.3f} over BL-Fuse, the best baseline, clearly better (95% interval +" in summary.sentences[0]
    assert "16 windows from 8 recordings" in summary.sentences[2]
    assert "1 row failed" in summary.sentences[2]
    assert "With so few recordings the intervals are rough." in summary.sentences[2]
    assert summary.sentences[2].endswith("Intervals of rows with 2 seeds leave out much of the chance in training.")
    assert [tile.label for tile in summary.tiles][-1] == "Mean (known)"
    assert all(0 <= tile.low <= tile.at <= tile.high <= 100 for tile in summary.tiles)
