"""Figures of each row with intervals: a bootstrap over recordings and, where there are several, over seeds.

Every row of a report is resampled with the same draws of recordings, and rows of as many seeds with the same draws of
seeds, so that differences between rows are paired. A recording is a whole log, whatever stretches it was cut into.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.errors import InputError
from semgrid_eval.report.estimates.division import EVERYWHERE, Division, RowSums, row_sums
from semgrid_eval.report.estimates.intervals import Estimate, intervals_of, stretched
from semgrid_eval.report.rows.load import Result, Row, comparable
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.scores.metrics.metric import (
    Counts,
    Floats,
    Metric,
    column_names,
    column_of,
    divided,
    mean_finite,
    places_of,
)
from semgrid_eval.scores.metrics.table import IOU, metrics_of

Level = Literal["recordings", "groups"]

DRAWS = 1000
SEED = 20190623
"""Any number does; a fixed one gives the same run the same intervals."""
_FEW = (
    "The fewer of them have cells of a class, the longer the interval is made, by the t distribution; where one "
    "alone has, there is none."
)
_SENTENCES: Mapping[Level, str] = {
    "recordings": "Intervals come from resampling recordings, taken as independent of each other, and seeds where "
    f"there are several. {_FEW} For recordings that depend on each other, semgrid-eval report --resample groups "
    "resamples towns, cities or drives first.",
    "groups": "Intervals come from resampling groups of recordings (towns, cities or drives), then recordings within "
    f"each group, since recordings of one group may depend on each other, and seeds where there are several. {_FEW}",
}


@dataclass(frozen=True)
class Draws:
    """Resamples: `weights` (B, R) of recordings, and for each number S of seeds the `picks` (B, S) of them."""

    weights: NDArray[np.int64]
    picks: Mapping[int, NDArray[np.int64]]

    def resampled(self, sums: Counts) -> Counts:
        """Sum over recordings as often as each counts: (R, ...) -> (B, ...)."""
        flat = sums.reshape(len(sums), -1).astype(np.float64)  # BLAS knows floats only; exact below 2**53
        total = np.rint(self.weights.astype(np.float64) @ flat).astype(np.int64)
        return total.reshape(-1, *sums.shape[1:])

    def over_seeds(self, values: Floats) -> Floats:
        """Take the mean over the seeds that each resample picked: (B, S, Q) -> (B, Q)."""
        if values.shape[1] == 1:  # which is picked once in each
            return values[:, 0]
        present = np.isfinite(values) * self.picks[values.shape[1]][:, :, None]
        total, number = (present * np.nan_to_num(values)).sum(axis=1), present.sum(axis=1)
        return divided(total, number)


@dataclass(frozen=True)
class Resampling:
    """How rows are resampled: from which seed (a generator goes on where it is), how often, and by what first."""

    seed: int | np.random.Generator = 0
    draws: int = DRAWS
    level: Level = "recordings"

    @property
    def sentence(self) -> str:
        """What intervals come from, and why."""
        return _SENTENCES[self.level]

    def draw(self, groups: Sequence[str], seed_counts: Iterable[int]) -> Draws:
        """Draw resamples of recordings, given the group of each (R,), and of seeds."""
        generator = np.random.default_rng(self.seed)
        if self.level == "groups":
            weights = group_weights(groups, generator, draws=self.draws)
        else:
            weights = recording_weights(len(groups), generator, draws=self.draws)
        counts = sorted(set(seed_counts))
        picks = {count: generator.multinomial(count, np.full(count, 1 / count), size=len(weights)) for count in counts}
        return Draws(weights, picks)


def recording_weights(recordings: int, generator: np.random.Generator, *, draws: int) -> NDArray[np.int64]:
    """Draw how often each recording counts in each resample: (B, R); no draws where one recording is all there is."""
    if recordings < 2:
        return np.zeros((0, recordings), np.int64)
    return generator.multinomial(recordings, np.full(recordings, 1 / recordings), size=draws)


def group_weights(groups: Sequence[str], generator: np.random.Generator, *, draws: int) -> NDArray[np.int64]:
    """Draw groups, and for each time that a group is drawn, as many of its recordings as it has: (R,) -> (B, R)."""
    names, group_of = np.unique(np.asarray(groups, dtype=str), return_inverse=True)
    times = recording_weights(len(names), generator, draws=draws)  # (B, G)
    weights = np.zeros((len(times), len(groups)), np.int64)
    for group in range(len(names)):
        mine = np.flatnonzero(group_of == group)
        # Drawing m times n of n recordings is drawing m * n of them.
        weights[:, mine] = generator.multinomial(times[:, group] * len(mine), np.full(len(mine), 1 / len(mine)))
    return weights


@dataclass(frozen=True)
class RowScores:
    """Figures of one row in one region."""

    row: Row
    metric: Metric  # whose Q columns these are
    results: tuple[Result, ...]  # the S results behind them
    by_seed: Floats  # (S, Q) figures of each result
    draws: Floats  # (B, Q) of their mean, resampled
    totals: Counts  # (S, *shape) sums over windows
    windows: int  # how many windows have something to count in the region
    units: Counts  # (Q,) how many of what is resampled, recordings or groups, have cells behind each column
    by_inputs: bool = False  # whether rows of other inputs have other cells there

    @property
    def cells_key(self) -> tuple[object, ...]:
        """What rows must share to be compared in the region: their targets and, where it asks for that, inputs."""
        return self.row.question if self.by_inputs else (self.row.targets,)

    @cached_property
    def mean(self) -> dict[str, float]:
        """The mean over seeds of each column."""
        return dict(zip(column_names(self.metric), mean_finite(self.by_seed, axis=0).tolist(), strict=True))

    @cached_property
    def cells(self) -> dict[str, int]:
        """The cells behind each column, in one result."""
        return dict(zip(column_names(self.metric), self.metric.cells(self.totals[0]).tolist(), strict=True))

    def draws_of(self, columns: Sequence[str]) -> Floats:
        """Return the draws of some columns, in their order."""
        return self.draws[:, places_of(self.metric, columns)]

    @cached_property
    def estimates(self) -> Mapping[str, Estimate]:
        """The mean over seeds of each column with its interval."""
        return weighted_sums([(1, self)], column_names(self.metric))

    def estimate(self, column: str) -> Estimate:
        """Return a column's mean over seeds with its interval."""
        return self.estimates[column]

    def differences(self, other: "RowScores") -> dict[str, Estimate]:
        """Return the paired differences of all columns; a ValueError says that the other is scored on other cells."""
        return weighted_sums([(1, self), (-1, other)], column_names(self.metric))

    def minus(self, other: "RowScores", column: str) -> Estimate:
        """Return the paired difference to another row; a ValueError says that it is scored on other cells."""
        return weighted_sum([(1, self), (-1, other)], column)


Scores = Mapping[str, RowScores]
"""Rows' scores by their names."""
Parts = Mapping[str, Scores]
"""Scores by the name of the region."""
Everything = Mapping[str, Mapping[str, Parts]]
"""Scores by the names of metric, division and region."""


def weighted_sum(parts: Sequence[tuple[float, RowScores]], column: str) -> Estimate:
    """Add up rows' scores by their weights, draw by draw; a ValueError says that they are scored on other cells."""
    return weighted_sums(parts, [column])[column]


def weighted_sums(parts: Sequence[tuple[float, RowScores]], columns: Sequence[str]) -> dict[str, Estimate]:
    """Add up several columns of rows' scores likewise."""
    first = parts[0][1]
    for _, entry in parts:
        if not comparable(first.row, entry.row) or first.cells_key != entry.cells_key:
            raise ValueError(f"{first.row.name} and {entry.row.name} are scored on other targets or cells")
    values = [sum(weight * entry.mean[column] for weight, entry in parts) for column in columns]
    draws = np.sum([weight * entry.draws_of(columns) for weight, entry in parts], axis=0)
    units = fewest_units([entry for _, entry in parts], columns)
    limits = [_limits(parts, column) for column in columns]
    return dict(zip(columns, intervals_of(values, stretched(draws, units), limits), strict=True))


def fewest_units(entries: Sequence[RowScores], columns: Sequence[str]) -> Counts:
    """Count the recordings, or groups, that have cells behind each column, of the row that has fewest: (Q,)."""
    return np.asarray(np.min([entry.units[places_of(entry.metric, columns)] for entry in entries], axis=0))


def _limits(parts: Sequence[tuple[float, RowScores]], column: str) -> tuple[float, float]:
    """Return between what a weighted sum of a column's values lies."""
    ends = column_of(parts[0][1].metric, column).limits
    lowest, highest = (sum(pick(weight * end for end in ends) for weight, _ in parts) for pick in (min, max))
    return lowest, highest


def score_all(rows: Sequence[Row], divisions: Sequence[Division], resampling: Resampling) -> Everything:
    """Score rows by every metric in all regions of the divisions.

    Raises:
        InputError: rows have different classes.
    """
    return {
        metric.name: {each.name: score_regions(rows, metric, each, resampling) for each in divisions}
        for metric in metrics_of(classes_of(rows)).values()
    }


def classes_of(rows: Iterable[Row]) -> ClassSet:
    """Return the classes of rows that are scored side by side; the default ones where no row has a result.

    Where their colours are different, those of the first row count.

    Raises:
        InputError: they have different ones, so that their figures have nothing in common.
    """
    known = [row for row in rows if row.results]
    if not known:
        return DEFAULT_CLASSES
    first = known[0]
    for other in known:
        if not other.classes.means(first.classes):
            fault = f"row {other.name} has other classes than {first.name} of {first.run}: report them apart"
            raise InputError(fault, path=other.run, field="grid.classes")
    return first.classes


def shared_iou(entries: Iterable[RowScores]) -> Iou:
    """Return the IoU that rows are scored by; it says which figures there are for their classes."""
    return next((entry.metric for entry in entries if isinstance(entry.metric, Iou)), IOU)


def everywhere(everything: Everything, metric: str) -> Scores:
    """Return the scores of all cells by a metric."""
    return everything[metric][EVERYWHERE.name].get("all", {})


def score_everywhere(rows: Iterable[Row], metric: Metric, resampling: Resampling) -> Scores:
    """Score rows by a metric over all cells; rows without results or with nothing to count are left out."""
    known = [row for row in rows if row.results]
    return score_regions(known, metric, EVERYWHERE, resampling).get("all", {})


def score_regions(rows: Sequence[Row], metric: Metric, division: Division, resampling: Resampling) -> dict[str, Scores]:
    """Score rows by a metric in each region of a division; regions and rows with nothing to count are left out."""
    sums = [row_sums(row, metric, division) for row in rows]
    found: dict[str, Scores] = {}
    for number, region in enumerate(division.regions):
        counted = [(row, mine[number]) for row, mine in zip(rows, sums, strict=True) if mine[number].windows]
        if counted:
            scores = _score_region(counted, metric, resampling)
            found[region] = {name: replace(each, by_inputs=division.by_inputs) for name, each in scores.items()}
    return found


def _score_region(counted: Sequence[tuple[Row, RowSums]], metric: Metric, resampling: Resampling) -> Scores:
    seen = {name: row for row, sums in counted for part in sums.parts for name in part.recordings.tolist()}
    names = sorted(seen)
    groups = {name: seen[name].group_of[name] for name in names}
    draws = resampling.draw(list(groups.values()), [len(sums.parts) for _, sums in counted])
    unit_of = groups if resampling.level == "groups" else {name: name for name in names}
    return {row.name: _score_row(row, sums, metric, unit_of, draws) for row, sums in counted}


def _score_row(row: Row, sums: RowSums, metric: Metric, unit_of: Mapping[str, str], draws: Draws) -> RowScores:
    by_seed = metric.figures(metric.ratios(sums.totals))
    resampled = draws.over_seeds(metric.figures(draws.resampled(sums.by_recording(list(unit_of)))))
    results = tuple(part.result for part in sums.parts)
    return RowScores(row, metric, results, by_seed, resampled, sums.totals, sums.windows, sums.units(unit_of))
