"""The figures of scores: category bars as the paper's Fig. 5, training curves and scores over the horizon."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from semgrid_eval.classes import CATEGORY_NAMES
from semgrid_eval.report.estimates import CATEGORY_COLUMNS, RowScores
from semgrid_eval.report.figure import INK, PALETTE, SETTINGS, STROKES, Plot, finish, short
from semgrid_eval.report.reading import Row
from semgrid_eval.report.tables import LABELS

Scores = Mapping[str, RowScores]


def category_plots(scores: Scores) -> list[Plot]:
    """Draw the four panels of Fig. 5, one figure each."""
    return [_category_plot(scores, (name,), f"category_{name}") for name in CATEGORY_NAMES] if scores else []


def category_overview(scores: Scores) -> list[Plot]:
    """Draw the four panels in one figure."""
    return [_category_plot(scores, CATEGORY_NAMES, "categories")] if scores else []


def training_plots(rows: Sequence[Row]) -> list[Plot]:
    """Draw loss and validation loss over epochs, one figure for all trained rows."""
    trained = [row for row in rows if any(_curve(result.history, "loss") for result in row.results)]
    if not trained:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(7.2, 3.2), layout="constrained")
        axes = figure.add_subplot()
        for index, row in enumerate(trained):
            _training_curves(axes, row, index + 1)
        axes.set(xlabel="epoch", ylabel="loss", yscale="log")
        for ticks in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
            ticks(StrMethodFormatter("{x:g}"))
        axes.tick_params(axis="y", which="minor", labelsize=7)
        axes.legend(fontsize=8, ncols=1 + len(trained) // 4)
        caption = "Training loss (thin, one line a seed) and validation loss (thick, mean over seeds) by epoch."
        return [finish(figure, "training", "history.csv of each result", caption)]


def horizon_plots(scores: Scores) -> list[Plot]:
    """Draw category scores over the horizon, where a model was scored at several."""
    lines = _horizon_lines(scores)
    if not lines:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(7.2, 2.8), layout="constrained")
        for axes, category in zip(figure.subplots(1, len(CATEGORY_NAMES), sharex=True), CATEGORY_NAMES, strict=True):
            for index, (model, entries) in enumerate(lines.items()):
                steps = [entry.row.record.horizon_steps for entry in entries]
                values = [entry.mean[category] for entry in entries]
                axes.plot(steps, values, "o-", color=PALETTE[index % len(PALETTE)], label=short(model), markersize=4)
            axes.set(title=LABELS[category], xticks=sorted({*steps}), xlabel="horizon (steps)")
        figure.axes[0].legend(fontsize=8)
        return [finish(figure, "horizon", "categories.csv", "Category IoU over the horizon, in steps of the inputs.")]


def _category_plot(scores: Scores, categories: Sequence[str], name: str) -> Plot:
    assert set(categories) <= set(CATEGORY_COLUMNS)
    experiments, models = _axes_of(scores)
    width_in = min(14.0, max(4.6, 1.2 + 0.36 * len(experiments) * len(models)))
    columns = min(2, len(categories))
    lines = -(-len(categories) // columns)
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(width_in * columns, 2.7 * lines), layout="constrained")
        panels = np.atleast_1d(figure.subplots(lines, columns, sharey=False)).ravel()
        for axes, category in zip(panels, categories, strict=True):
            _bars(axes, scores, category, experiments, models)
        panels[0].legend(fontsize=8, ncols=len(models), loc="lower left", bbox_to_anchor=(0, 1.08), borderaxespad=0)
        words = ", ".join(LABELS[category].lower() for category in categories)
        caption = f"IoU of {words} by experiment; lines on the bars are 95% intervals."
        return finish(figure, name, "categories.csv", caption)


def _bars(axes: Axes, scores: Scores, category: str, experiments: list[str], models: list[str]) -> None:
    wide = 0.8 / len(models)
    for at, model in enumerate(models):
        entries = [e for e in scores.values() if _model(e) == model]
        x = [experiments.index(_experiment(e)) + (at - (len(models) - 1) / 2) * wide for e in entries]
        estimates = [entry.estimate(category) for entry in entries]
        values = np.array([estimate.value for estimate in estimates])
        axes.bar(x, np.nan_to_num(values), 0.92 * wide, color=PALETTE[at % len(PALETTE)], label=short(model))
        for place, estimate in zip(x, estimates, strict=True):
            if np.isfinite(estimate.low):
                axes.plot([place, place], [estimate.low, estimate.high], color=INK, linewidth=1)
            label = f"{estimate.value:.2f}" if np.isfinite(estimate.value) else "absent"
            top = np.nanmax([estimate.value, estimate.high, 0.0])
            axes.annotate(label, (place, top), (0, 2), textcoords="offset points", ha="center", fontsize=7)
    axes.set_xticks(range(len(experiments)), [short(name) for name in experiments])
    axes.set_title(LABELS[category], loc="right")
    axes.set_ylabel("IoU")
    axes.grid(visible=False, axis="x")
    axes.margins(y=0.12)


def _axes_of(scores: Scores) -> tuple[list[str], list[str]]:
    """List experiments and models in the order of the matrix, baselines first."""
    entries = list(scores.values())
    models = dict.fromkeys(_model(e) for e in sorted(entries, key=lambda e: not e.row.is_baseline))
    return list(dict.fromkeys(_experiment(e) for e in entries)), list(models)


def _model(entry: RowScores) -> str:
    return entry.row.record.model


def _experiment(entry: RowScores) -> str:
    return entry.row.name.removeprefix(f"{entry.row.record.model}-")


def _horizon_lines(scores: Scores) -> dict[str, list[RowScores]]:
    """Group rows by model where their experiments differ in the horizon only: DC, PH1, PH2, ..."""
    lines: dict[str, list[RowScores]] = {}
    for entry in scores.values():
        if entry.row.record.experiment.startswith(("DC", "PH")):
            lines.setdefault(_model(entry) + entry.row.name.partition(" ")[2], []).append(entry)
    ordered = {m: sorted(e, key=lambda entry: entry.row.record.horizon_steps) for m, e in lines.items()}
    return {m: e for m, e in ordered.items() if len({entry.row.record.horizon_steps for entry in e}) > 1}


def _training_curves(axes: Axes, row: Row, index: int) -> None:
    colour, stroke = PALETTE[index % len(PALETTE)], STROKES[index // len(PALETTE) % len(STROKES)]
    curves = [_curve(result.history, "loss") for result in row.results]
    for curve in curves:
        axes.plot(range(1, len(curve) + 1), curve, color=colour, linestyle=stroke, linewidth=0.7, alpha=0.6)
    checks = [_curve(result.history, "validation_loss") for result in row.results]
    shortest = min((len(check) for check in checks if check), default=0)
    mean = np.array([check[:shortest] for check in checks if check], np.float64).reshape(-1, shortest).mean(axis=0)
    label = short(row.name)
    if np.isfinite(mean).any():
        axes.plot(range(1, shortest + 1), mean, color=colour, linestyle=stroke, linewidth=2, label=label)
    else:
        axes.plot([], [], color=colour, linestyle=stroke, label=label)


def _curve(history: Any, column: str) -> list[float]:  # noqa: ANN401 - a data frame or None
    if history is None or column not in history:
        return []
    return [float(value) for value in pd.to_numeric(history[column], errors="coerce")]
