import numpy as np
import pytest
from support.scoring import score_rows

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.report.claims.claims import paper_table
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables import scores as tables
from semgrid_eval.scores.metrics.table import IOU


@pytest.fixture(scope="module")
def scores(run):
    return score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=50)


def shown(scores, on_cityscapes=()):
    return tables.score_tables(scores, [""], on_cityscapes)


def _body(table, name):
    return next(body for body in table.bodies if body[0].header == name)


def test_a_row_of_the_paper_stands_above_its_values_and_the_difference(scores):
    value, paper, difference = _body(shown(scores, [scores["ED-DC"].row.run])["classes"], "ED-DC")
    car = CLASS_NAMES.index("car")
    assert paper.cells[car].text == "0.610"
    assert value.cells[car].sort - paper.cells[car].sort == pytest.approx(difference.cells[car].sort)


def test_a_row_that_the_paper_lacks_or_that_is_not_of_its_data_stands_alone(scores):
    assert len(_body(shown(scores, [scores["ED-DC"].row.run])["categories"], "BL-Fuse")) == 1
    assert "BL-Fuse" not in paper_table()
    assert len(_body(shown(scores)["categories"], "ED-DC")) == 1


def test_the_best_of_each_column_is_marked(scores):
    table = shown(scores)["categories"]
    for at in range(len(IOU.category_columns)):
        values = {body[0].cells[at].sort: body[0].cells[at].tone for body in table.bodies}
        assert [value for value, tone in values.items() if tone == "best"] == [max(values)]


def test_a_number_tells_what_stands_behind_it(scores):
    title = _body(shown(scores)["classes"], "ED-DC")[0].cells[CLASS_NAMES.index("car")].title
    for words in ("cells", "16 windows", "3 seeds", "95% interval"):
        assert words in title


def test_confusions_are_shares_of_the_targets_cells(scores):
    entry = scores["ED-DC"]
    table = tables.confusion_table(entry, "confusion")
    counts = sum(result.counts.sum(axis=0) for result in entry.row.results)
    for line, target in zip(table.bodies, counts, strict=True):
        if target.sum():
            assert [cell.sort for cell in line[0].cells] == pytest.approx(target / target.sum())
