"""The one figure of a page: every row by category as marks with intervals, beside the paper's values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, isfinite

from semgrid_eval.report.claims.claims import paper_value
from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, shared_iou
from semgrid_eval.report.figures.categories import Group, lay_out
from semgrid_eval.report.figures.style import family_colours
from semgrid_eval.report.rows.words import model_words
from semgrid_eval.report.tables.numbers import number
from semgrid_eval.report.tables.values import best_rows, evidence

_STEP = 0.05  # of the ends of an axis
_OF_TRUTH = "currentColor"


@dataclass(frozen=True)
class Mark:
    """A value with its interval and the paper's, as text and as places along an axis (percent); None is absent."""

    text: str
    title: str
    best: bool
    at: float | None
    low: float | None
    high: float | None
    paper: float | None


@dataclass(frozen=True)
class Entry:
    """A row of the figure."""

    name: str
    number: int
    title: str
    told: bool  # whether it is told more than any model could know
    colour: str
    marks: tuple[Mark, ...]


@dataclass(frozen=True)
class Code:
    """What a model does, in words, and the names of its rows."""

    names: tuple[str, ...]
    words: str
    colour: str
    numbers: tuple[int, ...]


@dataclass(frozen=True)
class Chart:
    """The figure: its axes, groups of rows that are asked the same, and what their names stand for."""

    axes: tuple[tuple[str, str], ...]  # label, and the ends
    groups: tuple[tuple[str, tuple[Entry, ...]], ...]
    codes: tuple[Code, ...]
    has_paper: bool

    @property
    def has_told(self) -> bool:
        """Whether a row is told more than any model could know."""
        return any(entry.told for _, entries in self.groups for entry in entries)

    @property
    def name_characters(self) -> int:
        """The room that names need."""
        return max((len(entry.name) for _, entries in self.groups for entry in entries), default=0)


@dataclass(frozen=True)
class _Axis:
    low: float
    high: float

    def place(self, value: float) -> float | None:
        return round(100 * (value - self.low) / (self.high - self.low), 1) if isfinite(value) else None


def draw_chart(scores: Scores) -> Chart:
    """Lay the figure out: rows that are asked the same stand together, baselines first, who is told the truth last."""
    iou = shared_iou(scores.values())
    axes = {column: _axis(scores, column) for column in iou.compared}
    best = {column: best_rows(scores, column) for column in iou.compared}
    colours = family_colours(entry.row for entry in scores.values() if not entry.row.uses_truth)

    def entry(name: str) -> Entry:
        row, colour = scores[name].row, colours.get(scores[name].row.record.facts.family, _OF_TRUTH)
        marks = tuple(_mark(scores[name], column, axis, best=name in best[column]) for column, axis in axes.items())
        return Entry(name, row.number, row.record.label, row.uses_truth or row.is_oracle, colour, marks)

    laid_out = lay_out(scores)
    stand_in = _places(scores, laid_out)
    groups = []
    for group in laid_out:
        told = [each.row.name for each in group.told if stand_in[each.row.name] is group]
        groups.append((group.words, tuple(map(entry, (*group.places, *told)))))
    ends = tuple((iou.labels[column], f"{axis.low:.2f} to {axis.high:.2f}") for column, axis in axes.items())
    paper = any(mark.paper is not None for _, entries in groups for each in entries for mark in each.marks)
    return Chart(ends, tuple(groups), _codes(scores, colours), paper)


def _places(scores: Scores, groups: Sequence[Group]) -> dict[str, Group]:
    """Choose where each row told of the truth stands: in its first group of rows with as many inputs, or its first."""
    found: dict[str, Group] = {}
    for group in groups:
        inputs = scores[next(iter(group.places))].row.record.facts.inputs
        for each in group.told:
            first = found.setdefault(each.row.name, group)
            others = scores[next(iter(first.places))].row.record.facts.inputs
            if inputs == each.row.record.facts.inputs != others:
                found[each.row.name] = group
    return found


def _axis(scores: Scores, column: str) -> _Axis:
    """Reach from the lowest to the highest of all values, their intervals and the paper's values."""
    found = [entry.estimate(column) for entry in scores.values()]
    values = [value for each in found for value in (each.value, each.low, each.high)]
    values += [paper_value(entry.row, column) for entry in scores.values()]
    known = [value for value in values if isfinite(value)] or [0.0]
    low = floor(min(known) / _STEP) * _STEP
    return _Axis(low, max(low + _STEP, ceil(max(known) / _STEP) * _STEP))


def _mark(entry: RowScores, column: str, axis: _Axis, best: bool) -> Mark:
    estimate, paper = entry.estimate(column), paper_value(entry.row, column)
    title = evidence(entry, column) + (f"; the paper's value, on Cityscapes: {number(paper)}" * isfinite(paper))
    places = (axis.place(value) for value in (estimate.value, estimate.low, estimate.high, paper))
    return Mark(number(estimate.value), title, best, *places)


def _codes(scores: Scores, colours: Mapping[str, str]) -> tuple[Code, ...]:
    models: dict[tuple[str, str], list[RowScores]] = {}
    for entry in scores.values():
        models.setdefault((entry.row.record.facts.family, model_words(entry.row)), []).append(entry)
    return tuple(_code(entries, words, colours.get(family, _OF_TRUTH)) for (family, words), entries in models.items())


def _code(entries: Sequence[RowScores], words: str, colour: str) -> Code:
    rows = [entry.row for entry in entries]
    return Code(tuple(row.name for row in rows), words, colour, tuple(row.number for row in rows))
