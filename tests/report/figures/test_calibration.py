from semgrid_eval.report.figures.calibration import calibration_plots
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.where import locate_rows


def test_trained_rows_have_a_calibration_curve_and_sure_baselines_none(run):
    rows = [row for row in load_runs([run])[0].rows if row.windows]
    (plot,) = calibration_plots(locate_rows(rows)[0])
    assert "ED-DC, error" in plot.svg
    assert "BL-DC" not in plot.svg
    assert calibration_plots(locate_rows(row for row in rows if row.is_baseline)[0]) == []
