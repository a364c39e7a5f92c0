"""The paper's Fig. 5: category scores of every experiment as bars, with intervals and the paper's own values."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.classes import CATEGORY_NAMES
from semgrid_eval.report.claims.paper import paper_table
from semgrid_eval.report.estimates.bootstrap import LABELS, RowScores, Scores
from semgrid_eval.report.figures.style import (
    INK,
    MUTED,
    PALETTE,
    PAPER_MARKS,
    RULE,
    SETTINGS,
    Plot,
    evidence,
    finish,
    paper_note,
    short,
)

_GROUPS = {"Sp": "SF: sensors fused", "SL": "SL: inputs", "PH": "PH: horizon"}
_GROUP = re.compile(r"(Sp|SL|PH)\d")
_GAP = 0.5  # between groups, in bars' places
_WIDEST_IN, _HALF_IN, _SQUEEZED_IN = 11.3, 5.5, 6.6
"""Widths: all of the page, half of it, and how wide a figure may be to be squeezed into that half."""
_LABEL_SHARE = 0.09  # of a panel's height, that a number above a bar takes


@dataclass(frozen=True)
class Layout:
    """Where each experiment stands on the axis, group by group, and the colour of each model."""

    places: dict[str, float]
    groups: dict[str, list[str]]
    colours: dict[str, str]

    @property
    def models(self) -> int:
        """The number of models, by which bars get their width."""
        return len(self.colours)


def category_plots(scores: Scores) -> list[Plot]:
    """Draw the four panels of Fig. 5, one figure each."""
    return [category_plot(scores, (name,), f"category_{name}") for name in CATEGORY_NAMES] if scores else []


def category_overview(scores: Scores) -> list[Plot]:
    """Draw the four panels in one figure."""
    return [category_plot(scores, CATEGORY_NAMES, "categories")] if scores else []


def lay_out(scores: Scores) -> Layout:
    """Put experiments in the order of the matrix, the paper's groups SF, SL and PH together, baselines first."""
    groups: dict[str, list[str]] = {}
    for experiment in dict.fromkeys(_experiment(entry) for entry in scores.values()):
        found = _GROUP.match(experiment)
        groups.setdefault(_GROUPS[found[1]] if found else "", []).append(experiment)
    places = {
        name: at + _GAP * number
        for at, (number, name) in enumerate((n, name) for n, names in enumerate(groups.values()) for name in names)
    }
    models = dict.fromkeys(e.row.record.model for e in sorted(scores.values(), key=lambda e: not e.row.is_baseline))
    return Layout(places, groups, {model: PALETTE[i % len(PALETTE)] for i, model in enumerate(models)})


def category_plot(scores: Scores, categories: Sequence[str], name: str) -> Plot:
    """Draw a panel for each of the categories, two to a line."""
    layout = lay_out(scores)
    natural_in = max(4.6, 1.2 + 0.36 * len(layout.places) * layout.models)
    width_in = min(natural_in, _WIDEST_IN if natural_in > _SQUEEZED_IN else _HALF_IN)
    columns = min(2, len(categories))
    lines = -(-len(categories) // columns)
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(width_in * columns, 2.7 * lines), layout="constrained")
        for axes, category in zip(np.atleast_1d(figure.subplots(lines, columns)).ravel(), categories, strict=True):
            _panel(axes, scores, category, layout)
        words = ", ".join(LABELS[category].lower() for category in categories)
        caption = f"IoU of {words} by experiment ({evidence(scores)}); lines are 95% intervals{paper_note(scores)}"
        return finish(figure, name, "summary.csv", caption)


def _panel(axes: Axes, scores: Scores, category: str, layout: Layout) -> None:
    wide, models = 0.8 / layout.models, list(layout.colours)
    label_iou = _LABEL_SHARE * _highest(scores, category)
    for experiment, place in layout.places.items():
        entries = [entry for entry in scores.values() if _experiment(entry) == experiment]
        entries.sort(key=lambda entry: models.index(entry.row.record.model))
        for at, entry in enumerate(entries):
            middle = place + (at - (len(entries) - 1) / 2) * wide
            _bar(axes, entry, category, middle, wide, layout.colours[entry.row.record.model])
            _number(axes, entry, category, middle, label_iou)
    for name, experiments in layout.groups.items():
        first, last = (layout.places[end] for end in (experiments[0], experiments[-1]))
        if name and len(layout.groups) > 1:
            axes.annotate(
                name,
                ((first + last) / 2, 0),
                (0, -24),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="center",
                color=MUTED,
                fontsize=7.5,
            )
        if first > 0:
            axes.axvline(first - (1 + _GAP) / 2, color=RULE, linewidth=0.8)
    axes.set_xticks(list(layout.places.values()), [short(name) for name in layout.places])
    axes.tick_params(axis="x", length=0)
    axes.set_title(LABELS[category], loc="left", fontweight="bold")
    axes.set_ylabel("IoU")
    axes.grid(visible=False, axis="x")
    axes.margins(x=0.02, y=0.12)
    axes.set_ylim(bottom=0)
    _legend(axes, layout)


def _bar(axes: Axes, entry: RowScores, category: str, place: float, wide: float, colour: str) -> None:
    """Draw a bar with its interval, its number and the paper's value."""
    estimate = entry.estimate(category)
    axes.bar(place, np.nan_to_num(estimate.value), 0.92 * wide, color=colour)
    if np.isfinite(estimate.low):
        axes.plot([place, place], [estimate.low, estimate.high], color=INK, linewidth=1)
    paper = _paper_value(entry, category)
    if np.isfinite(paper):
        axes.plot(place + 0.3 * wide, paper, "D", markersize=3.2, **PAPER_MARKS)


def _number(axes: Axes, entry: RowScores, category: str, place: float, label_iou: float) -> None:
    """Write a bar's number above it, and above the paper's mark where that would lie on the number."""
    estimate, paper = entry.estimate(category), _paper_value(entry, category)
    top = float(np.nanmax([estimate.value, estimate.high, 0.0]))
    hidden = np.isfinite(paper) and -label_iou / 4 < paper - top < label_iou
    label = f"{estimate.value:.2f}" if np.isfinite(estimate.value) else "absent"
    at = (place, max(top, paper) if hidden else top)
    axes.annotate(label, at, (0, 4 if hidden else 2), textcoords="offset points", ha="center", fontsize=7)


def _paper_value(entry: RowScores, category: str) -> float:
    return paper_table().get(entry.row.record.name, {}).get(category, np.nan)


def _highest(scores: Scores, category: str) -> float:
    """Return the highest value of a panel, which its height follows."""
    estimates = [entry.estimate(category) for entry in scores.values()]
    papers = [_paper_value(entry, category) for entry in scores.values()]
    return float(np.nanmax([0.0, *papers, *(v for e in estimates for v in (e.value, e.high))]))


def _legend(axes: Axes, layout: Layout) -> None:
    for model, colour in layout.colours.items():
        axes.bar(np.nan, np.nan, color=colour, label=short(model))
    axes.legend(
        fontsize=8,
        ncols=layout.models,
        loc="lower right",
        bbox_to_anchor=(1, 1),
        borderaxespad=0.2,
        handlelength=1,
        columnspacing=1,
    )


def _experiment(entry: RowScores) -> str:
    return entry.row.name.removeprefix(f"{entry.row.record.model}-")
