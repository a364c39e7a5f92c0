import numpy as np
import pytest

from semgrid_eval.report.estimates.bootstrap import Resampling, score_all
from semgrid_eval.report.estimates.paces import divisions
from semgrid_eval.report.page.exports import SUMMARY_COLUMNS, division_records, seed_frame, summary_frame
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import METRICS
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.scores.tidy import FIGURE_COLUMNS, load_figures


@pytest.fixture(scope="module")
def everything(run):
    runs = load_runs([run])
    return score_all(runs[0].rows, divisions(runs), Resampling(0, draws=20))


def test_there_is_a_line_for_each_row_seed_region_and_figure(run, everything):
    """The long table says what the run itself says, without a report."""
    table = seed_frame(everything)
    assert tuple(table.columns) == FIGURE_COLUMNS
    keys = ["row", "seed", "metric", "division", "region", "column"]
    assert not table.duplicated(keys).any()
    theirs = load_figures(run).set_index(keys)
    mine = table.set_index(keys)
    there = theirs.loc[mine.index]
    np.testing.assert_allclose(mine.value.astype(float), there.value)
    np.testing.assert_array_equal(mine.cells, there.cells)
    assert theirs.drop(mine.index).value.isna().all()  # regions that a row never met


def test_each_figure_has_its_interval_and_its_difference_to_the_baseline(everything):
    table = summary_frame(division_records(everything))
    assert tuple(table.columns) == SUMMARY_COLUMNS
    figures = table.set_index(["metric", "division", "region", "row", "column"])
    gap = figures.loc[("iou", "actors", "moving", "ED-DC", "vehicles")]
    entry, other = (everything["iou"]["actors"]["moving"][name] for name in ("ED-DC", "BL-DC"))
    assert gap.reference == "BL-DC"
    assert gap.difference == pytest.approx(entry.minus(other, "vehicles").value)
    assert gap.difference_low == pytest.approx(entry.minus(other, "vehicles").low)
    assert (gap.windows, gap.seeds) == (entry.windows, 3)
    assert set(table.metric) == set(METRICS)
    assert set(table.division) == set(PARTITIONS)  # this run knows no paces


def test_absent_numbers_are_null(everything):
    records = division_records(everything)["iou"]["all"]["all"]["BL-DC"]
    assert records["reference"] is None
    assert all(value is None or np.isfinite(value) for each in records["scores"].values() for value in each.values())


def test_without_rows_the_tables_are_empty():
    nothing = {"iou": {"all": {}}}
    assert seed_frame(nothing).empty
    assert summary_frame(division_records(nothing)).empty
