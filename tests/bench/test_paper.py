"""The paper at its own scale: what is run, and what the paper's own rows would cost."""

import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.bench.paper import kept_scores, paper_matrix, price_of_paper
from semgrid_eval.files import read_json
from semgrid_eval.report.page.write import write_report


def test_no_row_asks_for_a_second_target_which_carried_grids_lack():
    rows = {row.name: row for row in paper_matrix().rows}
    assert {"BL-Fuse", "BL-Fuse-SL5", "BL-Flow", "BL-Table", "ED-DC"} <= set(rows)
    assert [name for name, row in rows.items() if row.second_target is not None] == []


def test_only_rows_of_the_papers_table_are_priced(tmp_path):
    rows = (
        FakeRow("DC", "BL"),
        FakeRow("DC", "ED", seeds=1),
        FakeRow("NT", "ED", seeds=1),
        FakeRow("DC", "RN", seeds=1),
    )
    price = price_of_paper(make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1))
    # Three trainings of 80 s in 312.5 s, two of them of the paper's own rows.
    assert price["seconds_each"] == pytest.approx(312.5 / 3, abs=0.05)
    assert price["trainings"] == 200
    assert price["hours"] == pytest.approx(200 * 312.5 / 3 / 3600, abs=0.005)


def test_without_a_training_of_the_papers_rows_there_is_no_price(tmp_path):
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "RN", seeds=1))
    assert price_of_paper(make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1)) == {}


def test_scores_of_a_report_that_is_kept_are_read(tmp_path):
    report = write_report([make_fake_run(tmp_path / "run", recordings=2)], tmp_path / "report").parent
    found = kept_scores(report)
    for name, row in read_json(report / "report.json")["rows"].items():
        if row["scores"]:
            assert found[name]["vehicles"] == pytest.approx(row["scores"]["vehicles"]["value"], abs=5e-5)
            assert set(found[name]) < set(row["scores"])
    assert len(found) == 6
