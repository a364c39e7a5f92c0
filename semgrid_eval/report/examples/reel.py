"""A grid of examples that plays: what was seen, what came and what rows said of it, moment by moment."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial, reduce
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN, ClassSet
from semgrid_eval.errors import SemgridError
from semgrid_eval.report.estimates.bootstrap import Scores
from semgrid_eval.report.examples.choose import Contest, choose, contests
from semgrid_eval.report.examples.drawing import Frame, Grid, Picture, strip_picture
from semgrid_eval.report.figures.categories import horizon_lines
from semgrid_eval.report.rows.load import Row, key_of
from semgrid_eval.report.rows.pairing import Headline, reference_of
from semgrid_eval.scores.results import WindowRecord, read_predictions, read_windows

MOST_MOMENTS = 10
"""At half a second each, nobody has to stop what plays by itself: it ends within five seconds."""
_FEWEST_MOMENTS, _MOST_RIVALS, _BEST, _WORST = 3, 2, 2, 2
Frames = Sequence[Frame | None]
Show = Callable[[WindowRecord], Frames]
"""Gives what is shown of an example, by moment."""


@dataclass(frozen=True)
class Column:
    """A column of the grid of examples."""

    title: str
    show: Show
    rows: tuple[int, ...] = ()  # numbers of the rows whose answers it shows


@dataclass(frozen=True)
class Strip:
    """One example: a picture for each column, which holds the grids of all moments side by side."""

    title: str
    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class Reel:
    """Examples below each other that play together."""

    title: str
    hint: str
    columns: tuple[tuple[int, ...], ...]  # numbers of the rows that each column is of, none for inputs and targets
    moments: tuple[str, ...]
    strips: tuple[Strip, ...]


@dataclass(frozen=True)
class _Plan:
    """What a grid of examples plays: columns give what they show of each of the windows."""

    title: str
    hint: str
    moments: Sequence[str]
    columns: Sequence[Column]
    windows: Sequence[WindowRecord]

    def draw(self, classes: ClassSet) -> Reel:
        strips = (
            Strip(
                f"{window.recording}, frame {window.target_frame}",
                tuple(strip_picture(column.title, column.show(window), classes) for column in self.columns),
            )
            for window in self.windows
        )
        rows = tuple(column.rows for column in self.columns)
        return Reel(self.title, self.hint, rows, tuple(self.moments), tuple(strips))


class _Kept:
    """What rows kept of windows; None where they do not have one of its target."""

    def __init__(self) -> None:
        self._windows = lru_cache(2)(read_windows)
        self._predictions = lru_cache(16)(read_predictions)

    def seen(self, row: Row, window: WindowRecord, step: int = -1) -> Frame | None:
        """Return an input, all sensors in one; the newest, where no step is asked for."""
        found = self._at(row, window, self._windows(*row.window_set))
        return None if found is None else Frame(reduce(_behind, found["inputs"][:, step]))

    def target(self, row: Row, window: WindowRecord) -> Frame | None:
        """Return the target with mask M."""
        found = self._at(row, window, self._windows(*row.window_set))
        return None if found is None else Frame(found["target"], found["mask"] > 0)

    def answer(self, row: Row, window: WindowRecord) -> Frame | None:
        """Return what the row predicted."""
        found = self._at(row, window, self._predictions(row.shown.folder))
        return None if found is None else Frame(found["prediction"])

    @staticmethod
    def _at(row: Row, window: WindowRecord, arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]] | None:
        place = row.shown.places.get(key_of(window))
        return None if place is None else {name: array[place] for name, array in arrays.items()}


def moments_since(stamps_ns: Sequence[int]) -> tuple[str, ...]:
    """Name moments that follow each other by how many there are and the time since the first."""
    count, first_ns = len(stamps_ns), stamps_ns[0]
    return tuple(f"{number} of {count}, {(ns - first_ns) / 1e9:.1f} s" for number, ns in enumerate(stamps_ns, start=1))


def _behind(front: Grid, back: Grid) -> Grid:
    return np.where(front == UNKNOWN, back, front)


def make_reel(scores: Scores, rows: Sequence[Row], found: Headline | None, classes: ClassSet) -> Reel | None:
    """Draw the grid of examples, None where nothing was kept that could be shown.

    Recordings play over time where several windows of each are scored, else targets from farther and from nearer where
    a model was asked from several leads, else inputs up to the target.
    """
    plan = next((_plan(scores, contest, _Kept()) for contest in contests(rows, found)), None)
    with suppress(SemgridError, ValueError, IndexError):  # `failures` names what is damaged
        return plan.draw(classes) if plan is not None and plan.windows else None
    return None


def _plan(scores: Scores, contest: Contest, kept: "_Kept") -> _Plan:
    return _over_time(contest, kept) or _over_leads(scores, kept) or _up_to_target(contest, kept)


def _picked(contest: Contest) -> list[WindowRecord]:
    """Choose windows of several recordings by the rule of the other examples."""
    windows = contest.result.record.windows
    return [windows[pick.index] for pick in choose(contest, best=_BEST, worst=_WORST)]


def _over_time(contest: Contest, kept: _Kept) -> _Plan | None:
    """Play the scored windows around the chosen ones, where there are several of a recording."""
    ordered = sorted(contest.result.record.windows, key=lambda window: (window.recording, window.target_stamp_ns))
    by_recording = {name: list(each) for name, each in groupby(ordered, key=lambda window: window.recording)}
    picked = [window for window in _picked(contest) if len(by_recording[window.recording]) >= _FEWEST_MOMENTS]
    if not picked:
        return None
    count = min(MOST_MOMENTS, *(len(by_recording[window.recording]) for window in picked))

    def around(window: WindowRecord) -> list[WindowRecord]:
        others = by_recording[window.recording]
        start = min(max(0, others.index(window) - count // 2), len(others) - count)
        return others[start : start + count]

    def over(give: Callable[[Row, WindowRecord], Frame | None], row: Row) -> Show:
        return lambda window: [give(row, each) for each in around(window)]

    model, rivals = contest.model, contest.rivals[:_MOST_RIVALS]
    since = moments_since([window.target_stamp_ns for window in around(picked[0])])
    hint = "Windows that follow each other: the newest input, the target, and what rows predicted."
    columns = [Column("Newest input", over(kept.seen, model)), Column("Target", over(kept.target, model))]
    columns += [Column(row.name, over(kept.answer, row), (row.number,)) for row in (model, *rivals)]
    return _Plan("Over time", hint, since, columns, picked)


def _over_leads(scores: Scores, kept: _Kept) -> _Plan | None:
    """Play targets from the longest lead to the shortest, for the model that was asked from most of them."""
    rows = [entry.row for entry in scores.values()]
    lines = [[entry.row for entry in reversed(line)] for line in horizon_lines(scores) if not line[0].row.is_stream]
    line = max((line for line in lines if not (line[0].is_baseline or line[0].uses_truth)), key=len, default=[])
    baselines = [row for row in (reference_of(row, rows) for row in line) if row is not None]
    if not _FEWEST_MOMENTS <= len(line) == len(baselines):
        return None

    def over(give: Callable[[Row, WindowRecord], Frame | None], asked: Sequence[Row]) -> Show:
        return lambda window: [give(row, window) for row in asked]

    leads = [f"{row.shown.record.lead_s:.2f} s ahead" for row in line]
    hint = "The same targets from longer and then from shorter leads: the newest input, and what rows made of it."
    targets = over(kept.target, [line[-1]] * len(line))
    columns = [Column("Newest input", over(kept.seen, line)), Column("Target", targets)]
    for asked in (line, baselines):
        numbers = tuple(dict.fromkeys(row.number for row in asked))
        columns.append(Column(_span(asked), over(kept.answer, asked), numbers))
    return _Plan("From farther and from nearer", hint, leads, columns, _picked(Contest(line[-1], (baselines[-1],))))


def _span(rows: Sequence[Row]) -> str:
    first, last = rows[0].name, rows[-1].name
    return first if first == last else f"{first} to {last}"


def _up_to_target(contest: Contest, kept: _Kept) -> _Plan:
    """Play inputs and then targets, where predictions appear."""
    model, picked = contest.model, _picked(contest)
    before_ns = [window.target_stamp_ns - ns for window in picked[:1] for ns in window.input_stamps_ns]
    before_ns = before_ns[-MOST_MOMENTS + 1 :]
    steps = range(-len(before_ns), 0)

    def seen(window: WindowRecord) -> Frames:
        return [*(kept.seen(model, window, step) for step in steps), kept.target(model, window)]

    def answer(row: Row, window: WindowRecord) -> Frames:
        return [*[None] * len(steps), kept.answer(row, window)]

    before = [f"{ns / 1e9:.2f} s before the target" for ns in before_ns]
    hint = "What was seen, then the target, and what rows predicted of it."
    asked = (model, *contest.rivals[:_MOST_RIVALS])
    columns = [Column("Inputs, then the target", seen)]
    columns += [Column(row.name, partial(answer, row), (row.number,)) for row in asked]
    return _Plan("Up to the target", hint, [*before, "the target"], columns, picked)
