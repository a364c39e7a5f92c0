"""How honest certainty is: shares of right cells by certainty, with the table behind the figure."""

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores
from semgrid_eval.report.figures.style import INK, SETTINGS, Plot, finish, line_style, short
from semgrid_eval.scores.metrics.table import CALIBRATION

_CAPTION = (
    "How often a model is right when it is so certain, above, and how many cells that are, below: of the cells that it "
    "does not leave unknown, all repeats together. It is honest on the dotted line; error is the expected calibration "
    "error, the mean over repeats."
)


def reliability_frame(entry: RowScores) -> pd.DataFrame:
    """Return certainty, right and cells of each bin that has cells, all repeats together."""
    table = pd.DataFrame(CALIBRATION.reliability(CALIBRATION.ratios(entry.totals.sum(axis=0)))._asdict())
    return table[table.cells > 0].reset_index(drop=True)


def calibration_frame(scores: Scores) -> pd.DataFrame:
    """Return the bins of all rows: row, certainty, right, cells."""
    columns = ["row", "certainty", "right", "cells"]
    parts = [reliability_frame(entry).assign(row=name)[columns] for name, entry in scores.items()]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def calibration_plots(scores: Scores) -> list[Plot]:
    """Draw the share of right cells over certainty, and of all cells below, for rows whose certainty varies."""
    curves = [(entry, table) for entry in scores.values() if len(table := reliability_frame(entry)) > 1]
    if not curves:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(7.4, 4.6), layout="constrained")
        right, cells = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
        right.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle=":")
        for index, (entry, table) in enumerate(curves, start=1):
            error = entry.mean["calibration_error"]
            style = line_style(index) | {"label": f"{short(entry.row.name)}, error {error:.3f}"}
            right.plot(table.certainty, table.right, marker="o", markersize=3, **style)
            cells.plot(table.certainty, table.cells / table.cells.sum(), linewidth=1.2, **style)
        right.set(ylabel="share of right cells", xlim=(0, 1), ylim=(0, 1))
        cells.set(xlabel="certainty", ylabel="of all cells", yscale="log")
        cells.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}%"))
        right.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        return [finish(figure, "calibration", "calibration.csv", _CAPTION)]
