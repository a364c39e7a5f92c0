from dataclasses import replace

import numpy as np
import pytest

from semgrid_eval.report.estimates.bootstrap import score_rows
from semgrid_eval.report.figures.diagrams import architecture_frame, architecture_plots, calibration_plots
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.where import locate_rows


@pytest.fixture(scope="module")
def rows(run):
    return [row for row in load_runs([run])[0].rows if row.windows]


def test_trained_rows_have_a_calibration_curve_and_sure_baselines_none(rows):
    (plot,) = calibration_plots(locate_rows(rows)[0])
    assert "ED-DC, error" in plot.svg
    assert "BL-DC" not in plot.svg
    assert calibration_plots(locate_rows(row for row in rows if row.is_baseline)[0]) == []


def _built(row, depth, features, *, translate=True):
    config = {"network": {"depth": depth, "features": features}, "translate": translate}
    record = row.results[0].record.model_copy(update={"config": config})
    return replace(row, name=f"d{depth}f{features}", results=(replace(row.results[0], record=record),))


def test_networks_of_several_builds_are_compared(rows):
    builds = [_built(rows[3], depth, features) for depth, features in ((2, 16), (3, 16), (3, 32))]
    (plot,) = architecture_plots(score_rows(builds, np.random.default_rng(0), draws=2))
    assert "16 features" in plot.svg
    assert "32 features" in plot.svg


def test_one_build_is_no_comparison(rows):
    assert architecture_plots(score_rows([_built(rows[3], 3, 16)], np.random.default_rng(0), draws=2)) == []
    assert architecture_plots(score_rows(rows, np.random.default_rng(0), draws=2)) == []


def test_networks_are_compared_where_nothing_but_their_build_differs(rows):
    builds = [_built(rows[3], depth, 16) for depth in (2, 3, 4)] + [_built(rows[3], 2, 32, translate=False)]
    scores = score_rows(builds, np.random.default_rng(0), draws=20)
    table = architecture_frame(scores).set_index("row")
    assert list(table.index) == ["d2f16", "d3f16", "d4f16"]
    assert (table.low <= table.iou).all()
    assert table.iou["d2f16"] == scores["d2f16"].mean["mean_known"]
    assert table.window_ms["d2f16"] == 1000 * 1.25 / rows[3].windows
