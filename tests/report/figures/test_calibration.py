import re

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


def test_a_long_legend_does_not_drive_the_panels_apart(scores):
    (plot,) = calibration_plots({f"{number}": scores["ED-DC"] for number in range(30)})
    panels = re.findall(r'<g id="axes_\d">\s*<g id="patch_\d+">\s*<path d="([^"]*)"', plot.svg)
    heights = [[float(y) for y in re.findall(r"[ML] \S+ (\S+)", path)] for path in panels]
    (_, upper_end), (lower_begin, lower_end) = ((min(each), max(each)) for each in heights)
    assert lower_begin - upper_end < 0.1 * lower_end


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
