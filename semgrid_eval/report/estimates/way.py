"""How far rows have come from what anybody has to what nobody exceeds, and the same rows on a second target."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, fewest_units
from semgrid_eval.report.estimates.intervals import Estimate, intervals_of, stretched
from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.report.rows.pairing import HEADLINE, way_of


@dataclass(frozen=True)
class Way:
    """The scores at both ends of a row's way."""

    lower: RowScores
    upper: RowScores

    def share(self, entry: RowScores, column: str) -> Estimate:
        """Return (row - lower) / (upper - lower), all resampled together; NaN where there is no way to go."""
        return self.shares(entry, [column])[column]

    def shares(self, entry: RowScores, columns: Sequence[str]) -> dict[str, Estimate]:
        """Return the shares of several columns."""
        values = [_share(entry.mean[name], self.lower.mean[name], self.upper.mean[name]) for name in columns]
        lower, upper = self.lower.draws_of(columns), self.upper.draws_of(columns)
        length = upper - lower
        covered = np.where(length > 0, entry.draws_of(columns) - lower, np.nan)
        shares = covered / np.where(length > 0, length, 1.0)
        units = fewest_units([self.lower, self.upper, entry], columns)
        return dict(zip(columns, intervals_of(values, stretched(shares, units)), strict=True))


def _share(value: float, low: float, high: float) -> float:
    return (value - low) / (high - low) if high > low else np.nan


def ways(scores: Scores, rows: Sequence[Row] = ()) -> Iterator[tuple[RowScores, Way]]:
    """Go through the rows that have a way to go, each with its ends.

    These are chosen from `rows`, so that they are the same in all regions, or from those of the scores.
    """
    known = rows or [entry.row for entry in scores.values()]
    for entry in scores.values():
        if (ends := way_of(entry.row, known)) is None:
            continue
        found = [scores.get(row.name) for row in ends]
        lower, upper = (each if each and each.cells_key == entry.cells_key else None for each in found)
        if lower is not None and upper is not None:
            yield entry, Way(lower, upper)


def against_expected(rows: Sequence[Row]) -> list[Row]:
    """Return the rows that are also scored against what is measured on average, with those counts."""
    found = [replace(row, results=tuple(map(_expected, row.results))) for row in rows if row.results]
    return [row for row in found if all(result.read_expected is not None for result in row.results)]


def _expected(result: Result) -> Result:
    return replace(result, read=result.read_expected or result.read)


@dataclass(frozen=True)
class Order:
    """The rows of the same targets that are scored against both, best first, and the pairs that change places."""

    measured: tuple[str, ...]
    expected: tuple[str, ...]

    @property
    def swapped(self) -> list[tuple[str, str]]:
        """The pairs, the one first that comes first against what is measured."""
        later = {name: place for place, name in enumerate(self.expected)}
        names = self.measured
        return [(a, b) for i, a in enumerate(names) for b in names[i + 1 :] if later[a] > later[b]]


def order_of(measured: Scores, expected: Scores, targets: str) -> Order:
    """Order the rows of some targets by the mean over classes, those told of the truth left out."""

    def best_first(scores: Scores) -> tuple[str, ...]:
        names = [n for n, entry in scores.items() if n in expected and not entry.row.uses_truth]
        names = [name for name in names if scores[name].row.targets == targets]
        return tuple(sorted(names, key=lambda name: -scores[name].mean[HEADLINE]))

    return Order(best_first(measured), best_first(expected))
