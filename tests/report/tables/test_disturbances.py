import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run
from support.scoring import score_rows

from semgrid_eval.report.page.write import write_report
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import headline, reference_of
from semgrid_eval.report.tables.disturbances import disturbance_table
from semgrid_eval.report.tables.numbers import MINUS

LATE, LOST = "inputs 3 frames late", "newest input lost"
ROWS = (
    FakeRow("late", "ED", 0.3, 2, disturbed=LATE),
    FakeRow("lost", "ED", 0.5, 2, disturbed=LOST),
    FakeRow("DC", "ED", 0.06, 2),
    FakeRow("late", "BL", disturbed=LATE),
    FakeRow("plain", "BL"),
    FakeRow("far", "BL", horizon_steps=2, disturbed=LATE),  # nothing undisturbed looks as far
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_fake_run(tmp_path_factory.mktemp("runs") / "run", rows=ROWS, recordings=4)


@pytest.fixture(scope="module")
def rows(folder):
    return {row.name: row for row in load_runs([folder])[0].rows}


@pytest.fixture(scope="module")
def scores(rows):
    return score_rows(tuple(rows.values()), np.random.default_rng(0), draws=50)


def test_each_model_has_a_card_of_what_it_loses(scores):
    table = disturbance_table(scores)
    assert [[line.header for line in body] for body in table.bodies] == [["ED-DC", LATE, LOST], ["BL-plain", LATE]]
    head, late, lost = table.bodies[0]
    assert head.cells[0].sort == pytest.approx(scores["ED-DC"].mean["mean_known"])
    for line, name in ((late, "ED-late"), (lost, "ED-lost")):
        loss = scores[name].minus(scores["ED-DC"], "mean_known")
        assert line.cells[0].sort == loss.value < 0
        assert (line.cells[0].tone, line.cells[0].text[0]) == ("loss", MINUS)
        assert line.cells[0].interval == (loss.low, loss.high)


def test_without_disturbed_rows_there_is_no_card(rows):
    plain = [rows["ED-DC"], rows["BL-plain"]]
    assert disturbance_table(score_rows(plain, np.random.default_rng(0), draws=2)) is None
    alone = [rows["ED-late"], rows["BL-plain"]]
    assert disturbance_table(score_rows(alone, np.random.default_rng(0), draws=2)) is None


def test_a_disturbed_row_is_measured_against_a_baseline_that_is_disturbed_alike(rows):
    every = list(rows.values())
    assert reference_of(rows["ED-late"], every) is rows["BL-late"]
    assert reference_of(rows["ED-DC"], every) is rows["BL-plain"]
    assert reference_of(rows["ED-lost"], every) is None


def test_the_head_of_the_page_is_about_inputs_as_they_are(scores):
    found = headline(scores)
    assert (found.compared, found.best.name, found.rival.name) == (2, "ED-DC", "BL-plain")


def test_the_cards_stand_on_the_page_and_beside_it(tmp_path):
    rows = (FakeRow("plain", "BL"), FakeRow("lost", "BL", disturbed=LOST))
    page = write_report(make_fake_run(tmp_path / "run", rows=rows, recordings=2), tmp_path / "report")
    text = page.read_text()
    assert "Disturbed inputs" in text
    assert text.index('data-table="disturbances"') > text.index('data-table="categories"')
    assert LOST in (tmp_path / "report" / "tables" / "disturbances.csv").read_text()
