from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import counted_row
from support.scoring import score_rows

from semgrid_eval.report.claims.claims import paper_table
from semgrid_eval.report.page.chart import draw_chart
from semgrid_eval.report.page.chooser import chooser_axes
from semgrid_eval.report.rows.load import Run


def _row(number, name, hits, **facts):
    row = counted_row(name, {"car": [hits] * 4, "large_vehicle": [hits] * 4})
    record = row.record.model_copy(update={"facts": row.record.facts.model_copy(update=facts)})
    return replace(row, record=record, number=number)


ROWS = (
    _row(1, "BL-DC", 50),
    _row(2, "ED-DC", 60),
    _row(3, "ED-SL5", 64, inputs=5),
    _row(4, "ceiling", 90, uses_truth=True, baseline=False, learns=False, bound="upper"),
)


@pytest.fixture(scope="module")
def chart():
    return draw_chart(score_rows(ROWS, np.random.default_rng(0), draws=20))


def test_rows_that_are_asked_the_same_stand_together_and_each_row_once(chart):
    groups = [(words, [entry.name for entry in entries]) for words, entries in chart.groups]
    assert groups == [
        ("2 inputs, sensor front, 0.29 s ahead", ["BL-DC", "ED-DC", "ceiling"]),
        ("5 inputs", ["ED-SL5"]),
    ]
    assert [entry.number for _, entries in chart.groups for entry in entries] == [1, 2, 4, 3]


def test_a_ceiling_stands_beside_the_rows_with_as_many_inputs():
    told = {"uses_truth": True, "baseline": False, "learns": False, "bound": "upper", "model": "ceiling"}
    more = (_row(5, "ceiling-SL5", 92, inputs=5, **told), _row(6, "ceiling-SL7", 93, inputs=7, **told))
    rows = (*ROWS[:2], _row(7, "ED-SL3", 62, inputs=3), ROWS[2], _row(4, "ceiling", 90, **told), *more)
    groups = draw_chart(score_rows(rows, np.random.default_rng(0), draws=20)).groups
    names = [[entry.name for entry in entries] for _, entries in groups]
    assert names == [["BL-DC", "ED-DC", "ceiling"], ["ED-SL3", "ceiling-SL7"], ["ED-SL5", "ceiling-SL5"]]


def test_marks_stand_where_values_lie_between_the_ends_of_an_axis(chart):
    label, ends = chart.axes[3]
    low, high = map(float, ends.split(" to "))
    assert label == "Vehicles"
    for entry in chart.groups[0][1]:
        mark = entry.marks[3]
        assert mark.at == pytest.approx(100 * (float(mark.text) - low) / (high - low), abs=0.1)
        assert 0 <= mark.low <= mark.at <= mark.high <= 100
    paper = chart.groups[0][1][1].marks[3].paper
    assert paper == pytest.approx(100 * (paper_table()["ED-DC"]["vehicles"] - low) / (high - low), abs=0.1)


def test_the_best_of_those_that_compete_is_marked_and_who_is_told_is_not(chart):
    entries = {entry.name: entry for _, entries in chart.groups for entry in entries}
    assert [name for name, entry in entries.items() if entry.marks[3].best] == ["ED-SL5"]
    assert [name for name, entry in entries.items() if entry.told] == ["ceiling"]


def test_what_is_nowhere_has_no_mark(chart):
    mark = chart.groups[0][1][2].marks[4]  # nobody small and moving, and no such row in the paper
    assert (mark.text, mark.at, mark.low, mark.paper) == ("\N{EN DASH}", None, None, None)
    assert draw_chart({}).groups == ()


def test_rows_can_be_chosen_by_family_and_experiment_and_by_run_where_there_are_several():
    one, other = (Run(ROWS[0].run, tag, None, rows) for tag, rows in (("a", ROWS[:3]), ("b", ROWS[3:])))
    record = ROWS[0].record.model_copy(update={"results": ()})
    failed = replace(ROWS[0], number=9, results=(), record=record)
    axes = {axis.key: axis.choices for axis in chooser_axes([replace(one, rows=(*one.rows, failed)), other])}
    assert axes == {
        "families": {"BL": [1], "ED": [2, 3], "ceiling": [4]},
        "experiments": {"2 inputs, sensor front, 0.29 s ahead": [1, 2, 4], "5 inputs": [3]},
        "runs": {"a": [1, 2, 3], "b": [4]},
    }
    assert "runs" not in {axis.key for axis in chooser_axes([one])}
