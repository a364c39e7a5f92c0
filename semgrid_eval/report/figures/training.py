"""The losses of trainings over their epochs."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from semgrid_eval.report.figures.style import SETTINGS, Plot, finish, line_style, short
from semgrid_eval.report.rows.load import Row

HISTORY_COLUMNS = ("epoch", "updates", "learning_rate", "loss", "validation_loss", "seconds")


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
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        caption = "Training loss (thin, one line a seed) and validation loss (thick, mean over seeds) by epoch."
        return [finish(figure, "training", "training.csv", caption)]


def _draw_curves(axes: Axes, row: Row, style: dict[str, Any]) -> None:
    for curve in (_curve(result.history, "loss") for result in row.results):
        axes.plot(range(1, len(curve) + 1), curve, linewidth=0.7, alpha=0.6, **style)
    checks = [check for result in row.results if (check := _curve(result.history, "validation_loss"))]
    mean = [float(np.mean(losses)) for losses in zip(*checks, strict=False)]  # as far as the shortest goes
    axes.plot(range(1, len(mean) + 1), mean, linewidth=2, label=short(row.name), **style)


def _curve(history: Any, column: str) -> list[float]:  # noqa: ANN401 - a data frame or None
    if history is None or column not in history:
        return []
    return [float(value) for value in pd.to_numeric(history[column], errors="coerce")]
