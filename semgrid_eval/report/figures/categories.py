"""Category scores beside the paper's: as bars, grouped by question (its Fig. 5), and as lines over the lead time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from semgrid_eval.report.claims.claims import paper_value
from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, shared_iou
from semgrid_eval.report.figures import style
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import by_question, rows_alike, settings_but, told_beside
from semgrid_eval.report.rows.words import question_words

_GAP = 1.0  # between questions, in bars' places; the words of a question stand in it
_BAR_IN, _AROUND_IN = 0.19, 0.75  # height of a bar's place, and of title, legend and axis together
_LEAST_REACH = 0.05  # of a panel whose bars are all shorter, so that the numbers at its ticks are short, too
_ROOM = 1.2  # width of a panel by its longest bar, which leaves room for the numbers


@dataclass(frozen=True)
class Group:
    """The rows of one question, baselines first: where each stands, downwards, and the question in words."""

    words: str
    places: dict[str, float]
    told: tuple[RowScores, ...] = ()  # rows that are told of the truth about these targets: lines, not bars


def category_plots(scores: Scores) -> list[style.Plot]:
    """Draw a panel for each category side by side in one figure, which names the rows once."""
    groups = lay_out(scores)
    if not groups:
        return []
    places = [place for group in groups for place in group.places.values()]
    iou = shared_iou(scores.values())
    names = iou.classes.category_names
    rows_of_panels, columns = style.panel_grid(len(names))
    height_in = rows_of_panels * (_AROUND_IN + _BAR_IN * (max(places) + 1 + _GAP))
    with mpl.rc_context(style.SETTINGS):
        figure = Figure(figsize=(style.WIDE_IN, height_in), layout="constrained")
        panels = style.draw_panels(figure, [iou.labels[name] for name in names], sharey=True)
        colours = style.family_colours(entry.row for entry in scores.values() if not entry.row.uses_truth)
        strokes = style.truth_strokes(entry.row for entry in scores.values())
        for axes, category in zip(panels, names, strict=True):
            reach = _panel(axes, scores, category, groups, colours)
            reach = max([reach, *_draw_told(axes, category, groups, strokes)])
            axes.set_xlim(0, _ROOM * max(reach, _LEAST_REACH))
            axes.set_xticks([tick for tick in axes.get_xticks() if tick <= 1])
        for first in panels[::columns]:
            _name_rows(first, groups)
        handles: list[Artist] = [Patch(color=colour) for colour in colours.values()]
        handles += [Line2D([], [], color=style.INK, linestyle=stroke) for stroke in strokes.values()]
        labels = [style.short(name.replace("_", " ")) for name in (*colours, *strokes)]
        figure.legend(handles, labels, fontsize=8, ncols=len(labels), loc="outside upper right", handlelength=1.5)
        caption = f"Category IoU by row ({style.evidence(scores)}). Rows that answer the same question stand together;"
        caption += " lines are 95% intervals"
        caption += ", those across several bars the scores of who is told of the truth" if strokes else ""
        caption += style.paper_note(scores)
        return [style.finish(figure, "categories", "summary.csv", caption)]


def lay_out(scores: Scores) -> list[Group]:
    """Put the rows of each question together, baselines first, questions in the order of the matrix."""
    groups, at = [], 0.0
    known = [entry.row for entry in scores.values()]
    questions = by_question([row for row in known if not row.uses_truth])
    for rows, beside in zip(questions, _told(questions, known), strict=True):
        ordered = sorted(rows, key=lambda row: not row.is_baseline)
        words = question_words(rows[0], questions[0][0])
        told = tuple(scores[row.name] for row in known if row in beside)
        groups.append(Group(words, {row.name: at + i for i, row in enumerate(ordered)}, told))
        at += len(rows) + _GAP
    return groups


def _told(questions: Sequence[Sequence[Row]], rows: Sequence[Row]) -> list[list[Row]]:
    """Put the rows told of the truth beside each question; what is nearest to none stands beside the first it fits."""
    beside = [told_beside(question[0], rows) for question in questions]
    for row in rows:
        if row.uses_truth and not any(row in found for found in beside):
            fits = (found for found, asked in zip(beside, questions, strict=True) if row in rows_alike(asked[0], rows))
            next(fits, []).append(row)
    return beside


def _panel(axes: Axes, scores: Scores, category: str, groups: Sequence[Group], colours: Mapping[str, str]) -> float:
    """Draw the bars of a category and return how far they reach."""
    longest = 0.0
    for name, place in (item for group in groups for item in group.places.items()):
        entry = scores[name]
        longest = max(longest, _bar(axes, entry, category, place, colours[entry.row.record.facts.family]))
    axes.set_xlabel("IoU")
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x")
    return longest


def _draw_told(axes: Axes, category: str, groups: Sequence[Group], strokes: Mapping[str, Any]) -> Iterator[float]:
    """Draw what is reached with the truth across the bars of each group, and say how far that is."""
    for group in groups:
        ends = min(group.places.values()) - 0.5, max(group.places.values()) + 0.5
        for entry in group.told:
            value = entry.mean[category]
            axes.plot(
                [value, value], ends, color=style.INK, linestyle=strokes[entry.row.record.facts.model], linewidth=1
            )
            yield float(np.nan_to_num(value))


def _bar(axes: Axes, entry: RowScores, category: str, place: float, colour: str) -> float:
    """Draw a bar with its interval, the paper's value, and its number at the right edge; return how far it reaches."""
    estimate, paper = entry.estimate(category), paper_value(entry.row, category)
    axes.barh(place, np.nan_to_num(estimate.value), 0.78, color=colour)
    if np.isfinite(estimate.low):
        axes.plot([estimate.low, estimate.high], [place, place], color=style.INK, linewidth=1)
    if np.isfinite(paper):
        axes.plot(paper, place, "D", markersize=3.4, **style.PAPER_MARKS)
    label = f"{estimate.value:.2f}" if np.isfinite(estimate.value) else "absent"
    axes.text(1, place, label, transform=axes.get_yaxis_transform(), ha="right", va="center", fontsize=7)
    return float(np.nanmax([0.0, estimate.value, estimate.high, paper]))


def _name_rows(axes: Axes, groups: Sequence[Group]) -> None:
    """Write each row's name at its bar, and each question above its rows."""
    places = {name: place for group in groups for name, place in group.places.items()}
    axes.set_yticks(list(places.values()), [style.short(name) for name in places], fontsize=8)
    axes.set_ylim(max(places.values()) + 0.6, -_GAP - 0.3)  # downwards
    for group in groups if len(groups) > 1 else ():
        at = (0, min(group.places.values()) - 0.78)
        axes.annotate(
            style.short(group.words, 60),
            at,
            (2, 0),
            textcoords="offset points",
            va="center",
            color=style.MUTED,
            fontsize=7,
        )


def horizon_lines(scores: Scores) -> list[list[RowScores]]:
    """Return the rows of one run with the same targets that differ in the horizon alone, by lead; at least two."""
    lines: dict[object, dict[float, RowScores]] = {}
    for entry in scores.values():
        key = (entry.row.run, entry.row.targets, settings_but(entry.row, "horizon_steps"))
        lines.setdefault(key, {}).setdefault(_lead_s(entry), entry)  # rows that mean the same are one point
    found = [[line[lead] for lead in sorted(line)] for line in lines.values() if len(line) > 1]
    return sorted(found, key=lambda line: (line[0].row.uses_truth, not line[0].row.is_baseline))


def horizon_plots(scores: Scores) -> list[style.Plot]:
    """Draw category scores over the lead time with intervals, where a model was scored at several."""
    lines = horizon_lines(scores)
    if not lines:
        return []
    drawn = {entry.row.name: entry for line in lines for entry in line}
    with mpl.rc_context(style.SETTINGS):
        iou = shared_iou(drawn.values())
        names = iou.classes.category_names
        rows_of_panels, columns = style.panel_grid(len(names))
        figure = Figure(figsize=(style.WIDE_IN, 3.0 * rows_of_panels), layout="constrained")
        panels = style.draw_panels(figure, [iou.labels[name] for name in names], sharex=True)
        for axes, category in zip(panels, names, strict=True):
            for index, line in enumerate(lines):
                colour = style.INK if line[0].row.uses_truth else style.PALETTE[index % len(style.PALETTE)]
                _line(axes, line, category, colour)
            axes.set_xticks(leads := sorted({_lead_s(e) for e in drawn.values()}), [f"{lead:.2f}" for lead in leads])
            axes.margins(x=0.12)
        panels[0].set_ylabel("IoU")
        legend = panels[columns - 1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        style.mark_legend(legend, [[entry.row for entry in line] for line in lines])
        figure.supxlabel("lead time / s: from the newest input to the target", fontsize=9)
        caption = "Category IoU over the lead time with 95% intervals, a line for rows that differ in the horizon alone"
        caption += f" ({style.evidence(drawn)}){style.paper_note(drawn)}"
        return [style.finish(figure, "horizon", "summary.csv", caption)]


def _line(axes: Axes, line: Sequence[RowScores], category: str, colour: str) -> None:
    leads = [_lead_s(entry) for entry in line]
    estimates = [entry.estimate(category) for entry in line]
    name = style.short(f"{line[0].row.name} \N{HORIZONTAL ELLIPSIS} {line[-1].row.name}")
    form = "o:" if line[0].row.uses_truth else "o-"
    drawn: list[Artist] = [
        *axes.plot(leads, [e.value for e in estimates], form, color=colour, label=name, markersize=4)
    ]
    low, high = [e.low for e in estimates], [e.high for e in estimates]
    drawn.append(axes.fill_between(leads, low, high, color=colour, alpha=0.18, linewidth=0))
    papers = [paper_value(entry.row, category) for entry in line]
    drawn += axes.plot(leads, papers, "D", markersize=4, **(style.PAPER_MARKS | {"markeredgecolor": colour}))
    style.mark([entry.row for entry in line], *drawn)


def _lead_s(entry: RowScores) -> float:
    return entry.row.results[0].record.lead_s
