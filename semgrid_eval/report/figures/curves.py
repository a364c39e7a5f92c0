"""Curves with their tables: shares of right cells by certainty, and losses of trainings over epochs."""

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, StrMethodFormatter

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores
from semgrid_eval.report.figures.style import (
    INK,
    SETTINGS,
    Plot,
    finish,
    line_style,
    line_styles,
    mark,
    mark_legend,
    short,
)
from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.scores.metrics.table import CALIBRATION

_CAPTION = (
    "Above, how often a model is right by how certain it is; below, in how many cells it is so certain. Cells that it "
    "leaves unknown are left out, and all repeats are pooled. On the dotted line it is right as often as it says; "
    "error is the expected calibration error, the mean over repeats."
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
        figure = Figure(figsize=(7.4, max(4.6, 0.18 * len(curves))), layout="constrained")  # as high as its legend
        right, cells = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
        right.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle=":")
        for (entry, table), stroke in zip(curves, line_styles([entry.row for entry, _ in curves]), strict=True):
            error = entry.mean["calibration_error"]
            style = stroke | {"label": f"{short(entry.row.name)}, error {error:.3f}"}
            drawn = right.plot(table.certainty, table.right, marker="o", markersize=3, **style)
            drawn += cells.plot(table.certainty, table.cells / table.cells.sum(), linewidth=1.2, **style)
            mark([entry.row], *drawn)
        right.set(ylabel="share of right cells", xlim=(0, 1), ylim=(0, 1))
        cells.set(xlabel="certainty", ylabel="of all cells", yscale="log")
        cells.yaxis.set_major_formatter(FuncFormatter(lambda share, _: f"{100 * share:g}%"))
        legend = figure.legend(*right.get_legend_handles_labels(), fontsize=8, loc="outside right upper")
        mark_legend(legend, [[entry.row] for entry, _ in curves])
        return [finish(figure, "calibration", "calibration.csv", _CAPTION)]


HISTORY_COLUMNS = ("epoch", "updates", "learning_rate", "loss", "validation_loss")
TIMING_COLUMNS = ("row", "seed", "of", "epoch", "seconds")


def training_frame(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the histories of all trainings behind the rows: row, seed and `HISTORY_COLUMNS`."""
    columns = ["row", "seed", *HISTORY_COLUMNS]
    parts = [
        result.history.assign(row=row.name, seed=result.record.seed).reindex(columns=columns)
        for row in rows
        for result in row.results
        if result.history is not None
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def timing_frame(rows: Sequence[Row]) -> pd.DataFrame:
    """Return all that was measured with a clock and differs from one start to the next: `TIMING_COLUMNS`.

    Seconds are `of` an epoch, of a whole training, and of the prediction of all windows of a result.
    """
    lines = [
        (row.name, result.record.seed, *measured)
        for row in rows
        for result in row.results
        for measured in _times(result)
    ]
    return pd.DataFrame(lines, columns=list(TIMING_COLUMNS)).astype({"seed": "Int64", "epoch": "Int64"})


def _times(result: Result) -> Iterator[tuple[str, int | None, float]]:
    if result.history is not None:
        for epoch, seconds in zip(result.history["epoch"], result.history["seconds"], strict=True):
            yield "epoch", int(epoch), float(seconds)
    if result.record.train_seconds is not None:
        yield "training", None, result.record.train_seconds
    yield "prediction", None, result.record.predict_seconds


def training_plots(rows: Sequence[Row]) -> list[Plot]:
    """Draw loss and validation loss over epochs, one figure for all trained rows."""
    trained = [row for row in rows if any(_curve(result.history, "loss") for result in row.results)]
    if not trained:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(9.0, 3.4), layout="constrained")
        axes = figure.add_subplot()
        for index, row in enumerate(trained, start=1):
            _draw_curves(axes, row, line_style(index))
        axes.set(xlabel="epoch", ylabel="loss: mean cross-entropy of a cell", yscale="log")
        for ticks in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
            ticks(StrMethodFormatter("{x:g}"))
        axes.tick_params(axis="y", which="minor", labelsize=7)
        legend = axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        mark_legend(legend, [[row] for row in trained])
        caption = "Training loss (thin, one line a seed) and validation loss (thick, mean over seeds) by epoch."
        return [finish(figure, "training", "training.csv", caption)]


def _draw_curves(axes: Axes, row: Row, style: dict[str, Any]) -> None:
    for curve in (_curve(result.history, "loss") for result in row.results):
        mark([row], *axes.plot(range(1, len(curve) + 1), curve, linewidth=0.7, alpha=0.6, **style))
    checks = [check for result in row.results if (check := _curve(result.history, "validation_loss"))]
    mean = [float(np.mean(losses)) for losses in zip(*checks, strict=False)]  # as far as the shortest goes
    mark([row], *axes.plot(range(1, len(mean) + 1), mean, linewidth=2, label=short(row.name), **style))


def _curve(history: Any, column: str) -> list[float]:  # noqa: ANN401 - a data frame or None
    if history is None or column not in history:
        return []
    return [float(value) for value in pd.to_numeric(history[column], errors="coerce")]
