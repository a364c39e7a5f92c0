"""Values with their intervals: the quantiles of what resamples gave, as far apart as few recordings ask."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from semgrid_eval.report.estimates.student import stretch
from semgrid_eval.scores.metrics.metric import Counts, Floats

LEVEL = 0.95


@dataclass(frozen=True)
class Estimate:
    """A value with its interval; NaN where there is none."""

    value: float
    low: float
    high: float


def stretched(draws: Floats, units: Counts) -> Floats:
    """Move draws (B, Q) away from the middle of their column until intervals are long enough for its `units` (Q,).

    Units are recordings or groups. Where one alone has something to count, it says nothing about others: all is NaN.
    """
    (middle,) = _of_finite(lambda found: np.median(found, axis=1)[None], draws, 1)
    longer = np.array([stretch(count, LEVEL) if count > 1 else np.nan for count in units.tolist()])
    return np.asarray(middle + longer * (draws - middle))


def intervals_of(
    values: Sequence[float], draws: Floats, limits: Sequence[tuple[float, float]] = ((-np.inf, np.inf),)
) -> list[Estimate]:
    """Give each of Q values the interval of its draws (B, Q), of those that are finite, within its limits or all's."""
    ends = _of_finite(lambda found: np.quantile(found, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=1), draws, 2)
    ends[:, ~np.isfinite(values)] = np.nan
    lows, highs = ends.clip(*np.transpose(limits)).tolist()
    return list(map(Estimate, values, lows, highs))


def _of_finite(work: Callable[[Floats], Floats], draws: Floats, count: int) -> Floats:
    """Work on the finite draws of each column: (B, Q) -> (count, Q), NaN where there are none.

    Columns with as many of them, most often all, are handed over together, (columns, draws).
    """
    finite = np.isfinite(draws)
    number, found = finite.sum(axis=0), np.full((count, draws.shape[1]), np.nan)
    for each in set(number.tolist()) - {0}:
        mine = number == each
        found[:, mine] = work(draws.T[mine][finite.T[mine]].reshape(-1, each))
    return found
