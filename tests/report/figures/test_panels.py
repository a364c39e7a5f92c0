"""Panels of figures stand in rows where there are more of them than fit beside each other."""

import warnings

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from semgrid_eval.report.figures.style import SETTINGS, WIDE_IN, draw_panels, finish, panel_grid


@pytest.mark.parametrize(("count", "grid"), [(1, (1, 1)), (5, (1, 5)), (6, (2, 3)), (11, (3, 4)), (17, (4, 5))])
def test_panels_stand_in_rows_of_five_at_most(count, grid):
    assert panel_grid(count) == grid


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 17])
def test_panels_of_many_categories_with_long_names_fit_on_a_page(count):
    titles = [f"Some quite long category name {number} (known)" for number in range(count)]
    with mpl.rc_context(SETTINGS), warnings.catch_warnings():
        warnings.simplefilter("error")  # a layout that does not fit is a warning of matplotlib's
        figure = Figure(figsize=(WIDE_IN, 2.7 * panel_grid(count)[0]), layout="constrained")
        panels = draw_panels(figure, titles, sharex=True)
        for axes in panels:
            axes.plot([0, 1], [0, 1])
        plot = finish(figure, "panels", "summary.csv", "")
    assert figure.axes == panels
    assert all(axes.get_position().width > 0.1 for axes in panels)
    assert plot.svg.count("category name") == count
