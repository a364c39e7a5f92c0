from dataclasses import replace

import numpy as np
import pytest

from semgrid_eval.report.diagrams import architecture_plots, calibration_plots
from semgrid_eval.report.estimates import score_rows
from semgrid_eval.report.reading import load_runs
from semgrid_eval.report.where import locate_rows


@pytest.fixture(scope="module")
def rows(run):
    return [row for row in load_runs([run])[0].rows if row.windows]


def test_trained_rows_have_a_calibration_curve_and_sure_baselines_none(rows):
    (plot,) = calibration_plots(locate_rows(rows)[0])
    assert "ED-DC, error" in plot.svg
    assert "BL-DC" not in plot.svg
    assert calibration_plots(locate_rows(row for row in rows if row.is_baseline)[0]) == []


def _built(row, depth, features):
    record = row.results[0].record.model_copy(update={"config": {"network": {"depth": depth, "features": features}}})
    return replace(row, name=f"d{depth}f{features}", results=(replace(row.results[0], record=record),))


def test_networks_of_several_builds_are_compared(rows):
    builds = [_built(rows[3], depth, features) for depth, features in ((2, 16), (3, 16), (3, 32))]
    (plot,) = architecture_plots(score_rows(builds, np.random.default_rng(0), draws=2))
    assert "16 features" in plot.svg
    assert "32 features" in plot.svg


def test_one_build_is_no_comparison(rows):
    assert architecture_plots(score_rows([_built(rows[3], 3, 16)], np.random.default_rng(0), draws=2)) == []
    assert architecture_plots(score_rows(rows, np.random.default_rng(0), draws=2)) == []
