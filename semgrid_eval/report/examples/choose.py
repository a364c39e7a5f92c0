"""Example windows, chosen by a rule: where a model most outperforms its baselines, and where it loses most.

The rule is the supplement's: the smaller of a model's leads over its baseline on moved and on unmoved inputs, for one
class or over all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.rows.load import Result, Row, comparable, key_of
from semgrid_eval.report.rows.pairing import Headline, reference_of, settings_but
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.metric import Floats, mean_finite
from semgrid_eval.scores.results import WindowRecord

MIN_CELLS = 10
"""A class counts in the choice of windows only where the target has at least this many of its cells."""

_MOST_RIVALS = 2


@dataclass(frozen=True)
class Contest:
    """A model and the rows that it is measured against: baselines, or the same model asked to look further ahead."""

    model: Row
    rivals: tuple[Row, ...]
    baselines: tuple[Row | None, ...] = ()  # in the second case, of the model's horizon and of each rival's

    @property
    def result(self) -> Result:
        """The result whose predictions are shown."""
        return self.model.shown

    @property
    def rule(self) -> str:
        """The rule of choice in words."""
        gaps = [f"IoU {self.model.name} \N{MINUS SIGN} IoU {rival.name}" for rival in self.rivals]
        if not gaps:
            return f"IoU {self.model.name}"
        return gaps[0] if len(gaps) == 1 else f"min({', '.join(gaps)})"


@dataclass(frozen=True)
class Pick:
    """One chosen window: its index in the contest's result, why it was chosen and its score under the rule."""

    index: int
    reason: str
    score: float


def contests(rows: Sequence[Row], headline: Headline | None) -> list[Contest]:
    """Choose who is measured against whom: the best model that is not a baseline first, then the other such rows.

    The first is measured against its baseline and against that baseline on inputs that are not moved, where there is
    one; then against itself where it looks further ahead. Without such a row, the best baseline is measured against
    another one; alone, against nobody.
    """
    if headline is None:
        return []
    models = (row for row in (headline.best, headline.rival) if row is not None and not row.is_baseline)
    main = next(models, headline.best)
    found = [Contest(main, tuple(_rivals(main, rows, headline)))]
    if later := _looking_further(main, rows):
        found.append(Contest(main, tuple(later), tuple(reference_of(row, rows) for row in (main, *later))))
    others = [(row, reference_of(row, rows)) for row in rows if not (row.is_baseline or row.uses_truth or row == main)]
    return found + [Contest(row, (reference,)) for row, reference in others if reference is not None]


def choose(contest: Contest, *, best: int, worst: int) -> list[Pick]:
    """Choose windows by the mean over classes: the largest values of the rule, then the smallest."""
    gaps = rule_values(contest)
    values = mean_finite(gaps[:, contest.model.classes.known])
    order = _ordered(values)
    top = _of_other_recordings(contest.result, order, best)
    left = _of_other_recordings(contest.result, order[~np.isin(order, top)][::-1], worst)
    what = "difference over all classes" if contest.rivals else "score over all classes"
    picks = [(i, f"Largest {what}") for i in top] + [(i, f"Smallest {what}") for i in left]
    return [Pick(i, reason, float(values[i])) for i, reason in picks]


def choose_by_class(contest: Contest) -> list[Pick]:
    """Choose, for each class but `unknown`, the window with the largest and the one with the smallest value."""
    gaps, picks = rule_values(contest), []
    classes = contest.model.classes
    for index in classes.known:
        order = _ordered(gaps[:, index])
        ends = [(order[0], "largest"), (order[-1], "smallest")] if len(order) > 1 else [(i, "only") for i in order]
        label = classes.names[index].replace("_", " ").capitalize()
        picks += [Pick(int(i), f"{label}, {end}", float(gaps[i, index])) for i, end in ends]
    return picks


def by_window(picks: Sequence[Pick]) -> list[tuple[Pick, ...]]:
    """Gather picks of the same window, windows in the order of their first pick."""
    found: dict[int, list[Pick]] = {}
    for pick in picks:
        found.setdefault(pick.index, []).append(pick)
    return [tuple(group) for group in found.values()]


def mean_iou(result: Result, window: WindowRecord) -> float:
    """Mean IoU of a result in one window over the known classes with enough cells; NaN where it has no such window."""
    if (at := result.places.get(key_of(window))) is None:
        return float("nan")
    counts = result.counts[[at]].astype(np.int64)
    values = np.where(counts.sum(axis=2) < MIN_CELLS, np.nan, class_iou(counts))
    return float(mean_finite(values[0, result.classes.known]))


def rule_values(contest: Contest) -> Floats:
    """Evaluate the rule for each window and class: (N, C); NaN where there is too little of the class."""
    counts = contest.result.counts
    mine = class_iou(counts.astype(np.int64))
    few = counts.sum(axis=2) < MIN_CELLS
    gaps = [mine - _aligned_iou(contest.result, rival.shown) for rival in contest.rivals] or [mine]
    return np.where(few, np.nan, np.minimum.reduce(gaps))


def _aligned_iou(result: Result, other: Result) -> Floats:
    """IoU of another result's windows in the order of `result`; NaN where it has no such window."""
    theirs = class_iou(other.counts.astype(np.int64))
    places = np.array([other.places.get(key_of(window), -1) for window in result.record.windows], np.intp)
    return np.where(places[:, None] >= 0, theirs[places], np.nan)


def _rivals(main: Row, rows: Sequence[Row], headline: Headline) -> list[Row]:
    reference = reference_of(main, rows)
    if reference is None:
        pair = (headline.best, headline.rival)
        return [row for row in pair if row is not None and row != main][:1]
    unmoved = reference.record.facts.model_copy(update={"translate": False})
    others = (row for row in rows if comparable(row, main) and row != reference)
    return [reference, *(row for row in others if row.record.facts == unmoved)][:_MOST_RIVALS]


def _looking_further(main: Row, rows: Sequence[Row]) -> list[Row]:
    """List the rows that are the main one but for a longer horizon, at the same targets: the nearest first."""
    mine, steps = settings_but(main, "horizon_steps"), main.record.facts.horizon_steps
    others = [row for row in rows if row.run == main.run and comparable(row, main)]
    found = [row for row in others if row.record.facts.horizon_steps > steps]
    alike = [row for row in found if settings_but(row, "horizon_steps") == mine]
    return sorted(alike, key=lambda row: row.record.facts.horizon_steps)


def _ordered(values: Floats) -> NDArray[np.intp]:
    """Order the windows that have a value, largest first, ties in the order of the windows."""
    order = np.argsort(-values, kind="stable")
    return order[np.isfinite(values[order])]


def _of_other_recordings(result: Result, order: NDArray[np.intp], count: int) -> list[int]:
    """Take the first windows of an order, one of each recording, so that examples show different scenes."""
    taken: dict[str, int] = {}
    for i in order.tolist():
        taken.setdefault(result.record.windows[i].recording, i)
    return list(taken.values())[:count]
