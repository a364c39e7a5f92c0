import numpy as np
import pytest

from semgrid_eval.report.estimates.bootstrap import Resampling, score_regions
from semgrid_eval.report.estimates.division import EVERYWHERE
from semgrid_eval.report.figures.curves import calibration_frame, calibration_plots
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import CALIBRATION


@pytest.fixture(scope="module")
def scores(run):
    rows = [row for row in load_runs([run])[0].rows if row.windows]
    return score_regions(rows, CALIBRATION, EVERYWHERE, Resampling(0, draws=5))["all"]


def test_trained_rows_have_a_calibration_curve_and_sure_baselines_none(scores):
    (plot,) = calibration_plots(scores)
    assert f"ED-DC, error {scores['ED-DC'].mean['calibration_error']:.3f}" in plot.svg
    assert "BL-DC" not in plot.svg
    assert calibration_plots({name: entry for name, entry in scores.items() if entry.row.is_baseline}) == []


def test_the_table_has_the_cells_of_all_repeats(scores):
    table = calibration_frame(scores)
    for name, entry in scores.items():
        mine = table[table.row == name]
        assert mine.cells.sum() == entry.totals[..., 0].sum()
        right = (mine.right * mine.cells).sum() / mine.cells.sum()
        assert right == pytest.approx(entry.totals[..., 1].sum() / entry.totals[..., 0].sum())
    assert np.isfinite(table[["certainty", "right"]]).all().all()


def test_without_rows_there_is_nothing_to_show():
    assert calibration_frame({}).empty
    assert calibration_plots({}) == []
