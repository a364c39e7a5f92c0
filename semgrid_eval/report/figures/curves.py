"""The curves of a report: scores over the horizon, and losses over epochs."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from semgrid_eval.classes import CATEGORY_NAMES
from semgrid_eval.report.claims.paper import paper_table
from semgrid_eval.report.estimates.bootstrap import LABELS, RowScores, Scores
from semgrid_eval.report.figures.style import (
    PALETTE,
    PAPER_MARKS,
    SETTINGS,
    Plot,
    evidence,
    finish,
    line_style,
    paper_note,
    short,
)
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
        for index, row in enumerate(trained):
            _training_curves(axes, row, index + 1)
        axes.set(xlabel="epoch", ylabel="loss: mean cross-entropy of a cell", yscale="log")
        for ticks in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
            ticks(StrMethodFormatter("{x:g}"))
        axes.tick_params(axis="y", which="minor", labelsize=7)
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        caption = "Training loss (thin, one line a seed) and validation loss (thick, mean over seeds) by epoch."
        return [finish(figure, "training", "training.csv", caption)]


def horizon_plots(scores: Scores) -> list[Plot]:
    """Draw category scores over the horizon with intervals, where a model was scored at several."""
    lines = _horizon_lines(scores)
    if not lines:
        return []
    drawn = {entry.row.name: entry for entries in lines.values() for entry in entries}
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(11.3, 3.0), layout="constrained")
        for axes, category in zip(figure.subplots(1, len(CATEGORY_NAMES), sharex=True), CATEGORY_NAMES, strict=True):
            for index, (model, entries) in enumerate(lines.items()):
                _horizon_line(axes, entries, category, PALETTE[index % len(PALETTE)], short(model))
            axes.set_title(LABELS[category], loc="left", fontweight="bold")
            axes.set_xticks(*_horizon_ticks(list(drawn.values())))
            axes.margins(x=0.12)
        figure.axes[0].set_ylabel("IoU")
        figure.axes[-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        figure.supxlabel("steps from the newest input to the target, and the mean time that they take", fontsize=9)
        caption = f"Category IoU over the horizon with 95% intervals ({evidence(drawn)}){paper_note(drawn)}"
        return [finish(figure, "horizon", "summary.csv", caption)]


def _horizon_line(axes: Axes, entries: Sequence[RowScores], category: str, colour: str, label: str) -> None:
    steps = [entry.row.record.horizon_steps for entry in entries]
    estimates = [entry.estimate(category) for entry in entries]
    axes.plot(steps, [e.value for e in estimates], "o-", color=colour, label=label, markersize=4)
    axes.fill_between(
        steps, [e.low for e in estimates], [e.high for e in estimates], color=colour, alpha=0.18, linewidth=0
    )
    for step, entry in zip(steps, entries, strict=True):
        paper = paper_table().get(entry.row.record.name, {}).get(category)
        if paper is not None:
            axes.plot(step, paper, "D", markersize=4, **(PAPER_MARKS | {"markeredgecolor": colour}))


def _horizon_ticks(entries: Sequence[RowScores]) -> tuple[list[int], list[str]]:
    """Label each horizon by its steps and, where results know the times of their inputs, the mean seconds."""
    leads: dict[int, list[int]] = {entry.row.record.horizon_steps: [] for entry in entries}
    for entry in entries:
        for window in entry.row.results[0].record.windows:
            if window.input_stamps_ns:
                leads[entry.row.record.horizon_steps].append(window.target_stamp_ns - window.input_stamps_ns[-1])
    steps = sorted(leads)
    return steps, [f"{step}\n{np.mean(leads[step]) / 1e9:.2f} s" if leads[step] else str(step) for step in steps]


def _horizon_lines(scores: Scores) -> dict[str, list[RowScores]]:
    """Group rows by model where their experiments differ in the horizon only: DC, PH1, PH2, ..."""
    lines: dict[str, list[RowScores]] = {}
    for entry in scores.values():
        if entry.row.record.experiment.startswith(("DC", "PH")):
            lines.setdefault(entry.row.record.model + entry.row.name.partition(" ")[2], []).append(entry)
    ordered = {m: sorted(e, key=lambda entry: entry.row.record.horizon_steps) for m, e in lines.items()}
    return {m: e for m, e in ordered.items() if len({entry.row.record.horizon_steps for entry in e}) > 1}


def _training_curves(axes: Axes, row: Row, index: int) -> None:
    style = line_style(index)
    curves = [_curve(result.history, "loss") for result in row.results]
    for curve in curves:
        axes.plot(range(1, len(curve) + 1), curve, linewidth=0.7, alpha=0.6, **style)
    checks = [_curve(result.history, "validation_loss") for result in row.results]
    shortest = min((len(check) for check in checks if check), default=0)
    mean = np.array([check[:shortest] for check in checks if check], np.float64).reshape(-1, shortest).mean(axis=0)
    label = short(row.name)
    if np.isfinite(mean).any():
        axes.plot(range(1, shortest + 1), mean, linewidth=2, label=label, **style)
    else:
        axes.plot([], [], label=label, **style)


def _curve(history: Any, column: str) -> list[float]:  # noqa: ANN401 - a data frame or None
    if history is None or column not in history:
        return []
    return [float(value) for value in pd.to_numeric(history[column], errors="coerce")]
