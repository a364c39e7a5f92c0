"""The figure of scores by distance draws the rows that are asked the same, band by band."""

import re

import pytest
from support.fake_run import REFERENCE_ROWS, FakeRow, make_fake_run

from semgrid_eval.report.estimates.bootstrap import Resampling, score_regions
from semgrid_eval.report.estimates.division import of_cells
from semgrid_eval.report.figures.distance import distance_plots
from semgrid_eval.report.figures.style import INK, line_styles
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.regions.distance import DISTANCE


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    kinds = (*REFERENCE_ROWS[:4], FakeRow("motion", "truth", 0.02, bound="told", learns=False))
    run = make_fake_run(tmp_path_factory.mktemp("runs") / "run", rows=kinds, recordings=3, windows=1)
    return load_runs([run])[0].rows


def _parts(rows):
    return score_regions(rows, IOU, of_cells(DISTANCE), Resampling(0, draws=50))


def test_rows_of_the_main_question_and_those_told_of_the_truth_are_drawn(rows):
    (plot,) = distance_plots(_parts(rows), rows)
    assert plot.source == "summary.csv"
    drawn = {int(number) for number in re.findall(r'data-row="(\d+)"', plot.inline_svg)}
    assert {row.name for row in rows if row.number in drawn} == {"BL-DC", "ED-DC", "truth-motion"}
    for text in ("Mean (known)", "Small dynamic", "20\N{EN DASH}40", "&gt; 60", "distance / m"):
        assert text in plot.svg
    assert "3 windows a row, 3 recordings" in plot.caption


def test_without_bands_there_is_no_figure(rows):
    assert distance_plots({}, rows) == []
    assert distance_plots({"0 to 20 m": _parts(rows)["0 to 20 m"]}, rows) == []
    assert distance_plots(_parts(rows), []) == []


def test_lines_are_in_colours_and_black_where_a_row_is_told_of_the_truth(rows):
    colours = {row.name: style["color"] for row, style in zip(rows, line_styles(rows), strict=True)}
    assert colours.pop("truth-motion") == INK
    assert INK not in colours.values()
    assert len(set(colours.values())) == len(rows) - 1
