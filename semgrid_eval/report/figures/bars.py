"""Category scores of every row as bars, grouped by question, with intervals and the paper's own values (its Fig. 5)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from semgrid_eval.classes import CATEGORY_NAMES
from semgrid_eval.report.claims.paper import paper_value
from semgrid_eval.report.estimates.bootstrap import LABELS, RowScores, Scores
from semgrid_eval.report.figures.style import (
    INK,
    MUTED,
    PAPER_MARKS,
    SETTINGS,
    Plot,
    evidence,
    family_colours,
    finish,
    paper_note,
    short,
)
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import by_question

_GAP = 1.0  # between questions, in bars' places; the words of a question stand in it
_BAR_IN, _AROUND_IN = 0.19, 0.75  # height of a bar's place, and of title, legend and axis together
_WIDE_IN = 11.3  # all of the page
_ROOM = 1.2  # width of a panel by its longest bar, which leaves room for the numbers


@dataclass(frozen=True)
class Group:
    """The rows of one question, baselines first: where each stands, downwards, and the question in words."""

    words: str
    places: dict[str, float]


def category_plots(scores: Scores) -> list[Plot]:
    """Draw a panel for each category side by side in one figure, which names the rows once."""
    if not scores:
        return []
    groups = lay_out(scores)
    places = [place for group in groups for place in group.places.values()]
    size_in = (_WIDE_IN, _AROUND_IN + _BAR_IN * (max(places) + 1 + _GAP))
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=size_in, layout="constrained")
        panels = figure.subplots(1, len(CATEGORY_NAMES), sharey=True)
        colours = family_colours(entry.row for entry in scores.values())
        for axes, category in zip(panels, CATEGORY_NAMES, strict=True):
            _panel(axes, scores, category, groups, colours)
        _name_rows(panels[0], groups)
        handles, labels = [Patch(color=colour) for colour in colours.values()], list(map(short, colours))
        figure.legend(handles, labels, fontsize=8, ncols=len(labels), loc="outside upper right", handlelength=1)
        caption = f"Category IoU by row ({evidence(scores)}). Rows that answer the same question stand together;"
        return [finish(figure, "categories", "summary.csv", f"{caption} lines are 95% intervals{paper_note(scores)}")]


def lay_out(scores: Scores) -> list[Group]:
    """Put the rows of each question together, baselines first, questions in the order of the matrix."""
    groups, at = [], 0.0
    questions = by_question([entry.row for entry in scores.values()])
    for rows in questions:
        ordered = sorted(rows, key=lambda row: not row.is_baseline)
        groups.append(Group(_words(rows[0], questions[0][0]), {row.name: at + i for i, row in enumerate(ordered)}))
        at += len(rows) + _GAP
    return groups


def _panel(axes: Axes, scores: Scores, category: str, groups: Sequence[Group], colours: Mapping[str, str]) -> None:
    longest = 0.0
    for name, place in (item for group in groups for item in group.places.items()):
        entry = scores[name]
        longest = max(longest, _bar(axes, entry, category, place, colours[entry.row.record.facts.family]))
    axes.set_title(LABELS[category], loc="left", fontweight="bold")
    axes.set_xlabel("IoU")
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x")
    axes.set_xlim(0, _ROOM * max(longest, 1e-3))
    axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 1])


def _bar(axes: Axes, entry: RowScores, category: str, place: float, colour: str) -> float:
    """Draw a bar with its interval, the paper's value, and its number at the right edge; return how far it reaches."""
    estimate, paper = entry.estimate(category), paper_value(entry.row.record.name, category)
    axes.barh(place, np.nan_to_num(estimate.value), 0.78, color=colour)
    if np.isfinite(estimate.low):
        axes.plot([estimate.low, estimate.high], [place, place], color=INK, linewidth=1)
    if np.isfinite(paper):
        axes.plot(paper, place, "D", markersize=3.4, **PAPER_MARKS)
    label = f"{estimate.value:.2f}" if np.isfinite(estimate.value) else "absent"
    axes.text(1, place, label, transform=axes.get_yaxis_transform(), ha="right", va="center", fontsize=7)
    return float(np.nanmax([0.0, estimate.value, estimate.high, paper]))


def _name_rows(axes: Axes, groups: Sequence[Group]) -> None:
    """Write each row's name at its bar, and each question above its rows."""
    places = {name: place for group in groups for name, place in group.places.items()}
    axes.set_yticks(list(places.values()), [short(name) for name in places], fontsize=8)
    axes.set_ylim(max(places.values()) + 0.6, -_GAP - 0.3)  # downwards
    for group in groups if len(groups) > 1 else ():
        above = min(group.places.values()) - 0.78
        axes.annotate(group.words, (0, above), (2, 0), textcoords="offset points", va="center", color=MUTED, fontsize=7)


def _words(row: Row, first: Row) -> str:
    """Say what a question asks, as far as it is not what the first one asks."""
    return ", ".join(_differences(row, first)) or ", ".join(_differences(row, None))


def _differences(row: Row, first: Row | None) -> Iterator[str]:
    mine, theirs = row.record.facts, None if first is None else first.record.facts
    if theirs is None or mine.inputs != theirs.inputs:
        yield f"{mine.inputs} input{'' if mine.inputs == 1 else 's'}"
    if theirs is None or mine.sensors != theirs.sensors:
        yield short(" + ".join(mine.sensors), 40)
    if theirs is None or (mine.horizon_steps, mine.step_frames) != (theirs.horizon_steps, theirs.step_frames):
        yield f"{row.results[0].record.lead_s:.2f} s ahead"
    if not mine.translate and (theirs is None or theirs.translate):
        yield "inputs not moved to the target's time"
    if mine.translate and theirs is not None and not theirs.translate:
        yield "inputs moved to the target's time"
    if first is not None and row.targets != first.targets:
        yield "other targets"
