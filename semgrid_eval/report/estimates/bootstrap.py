"""Scores of each row with intervals: a bootstrap over recordings and, where there are several, over seeds.

Every row of a report is resampled with the same draws of recordings, and rows of as many seeds with the same draws of
seeds, so that differences between rows are paired. A recording is a whole log, whatever stretches it was cut into.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES
from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.scores.iou import Counts, category_iou, class_iou, mean_finite, merged_category_iou

Array = NDArray[np.float64]

DRAWS = 1000
LEVEL = 0.95
CATEGORY_COLUMNS = ("static", "static_known", "small_static", "vehicles", "small_dynamic", "mean_known")
MERGED_COLUMNS = tuple(f"merged_{name}" for name in CATEGORY_COLUMNS if name != "mean_known")
COLUMNS = (*CLASS_NAMES, *CATEGORY_COLUMNS, *MERGED_COLUMNS)
"""Everything that is scored: the classes, the categories, and the categories with their classes merged."""
LABELS = {
    "static": "Static",
    "static_known": "Static (known)",
    "small_static": "Small static",
    "vehicles": "Vehicles",
    "small_dynamic": "Small dynamic",
    "mean_known": "Mean (known)",
    **{name: name.replace("_", " ") for name in CLASS_NAMES},
    "merged_static": "Static (merged)",
    "merged_static_known": "Static (known, merged)",
    "merged_small_static": "Small static (merged)",
    "merged_vehicles": "Vehicles (merged)",
    "merged_small_dynamic": "Small dynamic (merged)",
}
"""Each of `COLUMNS` in words."""


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; NaN where there is none."""

    value: float
    low: float
    high: float

    @property
    def sure(self) -> bool:
        """Whether the interval exists and excludes zero."""
        return self.low > 0 or self.high < 0


@dataclass(frozen=True)
class RowScores:
    """Scores of one row over Q = `COLUMNS`: by seed (S, Q), and the bootstrap's draws (B, Q) of their mean."""

    row: Row
    by_seed: Array
    draws: Array

    @cached_property
    def mean(self) -> dict[str, float]:
        """The mean over seeds of each column."""
        return dict(zip(COLUMNS, mean_finite(self.by_seed, axis=0).tolist(), strict=True))

    def estimate(self, column: str) -> Estimate:
        """Return a column's mean over seeds with its interval."""
        return _estimate(self.mean[column], self.draws[:, COLUMNS.index(column)])

    def minus(self, other: "RowScores", column: str) -> Estimate:
        """Return the paired difference to another row."""
        return weighted_sum([(1, self), (-1, other)], column)


Scores = Mapping[str, RowScores]
"""Rows' scores by their names."""


def weighted_sum(parts: Sequence[tuple[float, RowScores]], column: str) -> Estimate:
    """Add up rows' scores by their weights, draw by draw."""
    at = COLUMNS.index(column)
    value = sum(weight * entry.mean[column] for weight, entry in parts)
    return _estimate(value, np.sum([weight * entry.draws[:, at] for weight, entry in parts], axis=0))


def score_columns(counts: Counts) -> Array:
    """Score pooled counts (..., C, C) -> (..., Q) in the order of `COLUMNS`."""
    classes = class_iou(counts)
    merged = {f"merged_{name}": values for name, values in merged_category_iou(counts).items()}
    found = category_iou(classes) | merged
    parts = [found[name] for name in (*CATEGORY_COLUMNS, *MERGED_COLUMNS)]
    return np.concatenate([classes, np.stack(parts, axis=-1)], axis=-1)


def score_rows(rows: Iterable[Row], generator: np.random.Generator, *, draws: int = DRAWS) -> dict[str, RowScores]:
    """Score rows by name, all of them with the same draws of recordings; rows without windows are left out."""
    rows = [row for row in rows if row.windows]
    names = sorted({window.drive for row in rows for result in row.results for window in result.record.windows})
    weights = recording_weights(len(names), generator, draws=draws)
    index = {name: i for i, name in enumerate(names)}
    counts = sorted({len(row.results) for row in rows})
    picks = {count: generator.multinomial(count, np.full(count, 1 / count), size=len(weights)) for count in counts}
    return {row.name: _score_row(row, index, weights, picks[len(row.results)]) for row in rows}


def recording_weights(recordings: int, generator: np.random.Generator, *, draws: int) -> NDArray[np.int64]:
    """Draw how often each recording counts in each resample: (B, R); no draws where one recording is all there is."""
    if recordings < 2:
        return np.zeros((0, recordings), np.int64)
    return generator.multinomial(recordings, np.full(recordings, 1 / recordings), size=draws)


def counts_by_recording(result: Result, index: dict[str, int]) -> NDArray[np.int64]:
    """Sum the counts of a result's windows by recording: -> (R, C, C)."""
    total = np.zeros((len(index), CLASS_COUNT, CLASS_COUNT), np.int64)
    np.add.at(total, [index[window.drive] for window in result.record.windows], result.counts)
    return total


def _score_row(row: Row, index: dict[str, int], weights: NDArray[np.int64], picks: NDArray[np.int64]) -> RowScores:
    by_seed = np.array([score_columns(result.counts.sum(axis=0, dtype=np.int64)) for result in row.results])
    total, number = np.zeros((2, len(weights), len(COLUMNS)))
    for seed, result in enumerate(row.results):
        scores = _resampled_scores(counts_by_recording(result, index), weights)
        present = np.isfinite(scores) * picks[:, seed, None]
        total += present * np.nan_to_num(scores)
        number += present
    draws = np.divide(total, number, out=np.full(total.shape, np.nan), where=number > 0)
    return RowScores(row, by_seed, draws)


def _resampled_scores(counts: NDArray[np.int64], weights: NDArray[np.int64]) -> Array:
    flat = counts.reshape(len(counts), -1).astype(np.float64)  # BLAS knows floats only; exact below 2**53
    total = np.rint(weights.astype(np.float64) @ flat).astype(np.int64)
    return score_columns(total.reshape(-1, CLASS_COUNT, CLASS_COUNT))


def _estimate(value: float, draws: Array) -> Estimate:
    finite = draws[np.isfinite(draws)]
    if not np.isfinite(value) or len(finite) == 0:
        return Estimate(value, np.nan, np.nan)
    low, high = np.quantile(finite, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Estimate(value, float(low), float(high))
