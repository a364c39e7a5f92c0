"""Intervals of many columns at once are those of each column's finite draws."""

import numpy as np
import pytest

from semgrid_eval.report.estimates.intervals import LEVEL, Estimate, intervals_of, stretched
from semgrid_eval.report.estimates.student import stretch

DRAWS = np.random.default_rng(0).normal(0.4, 0.3, (200, 5))
DRAWS[3, 1] = DRAWS[7, 3] = np.nan
DRAWS[5:, 2] = np.nan
VALUES = [0.4, 0.3, 0.5, np.nan, 0.2]
UNITS = np.array([3, 3, 9, 3, 1])
LIMITS = [(0.0, 1.0), (-1.0, 1.0), (0.0, 1.0), (0.0, 1.0), (0.0, 1.0)]


def alone(value, draws, units, limits):
    """Return the interval of one column, by its finite draws alone."""
    draws = draws[np.isfinite(draws)]
    if not np.isfinite(value) or units < 2:
        return Estimate(value, np.nan, np.nan)
    middle = np.median(draws)
    ends = np.quantile(middle + stretch(units, LEVEL) * (draws - middle), [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Estimate(value, *ends.clip(*limits).tolist())


def test_columns_together_are_each_alone_to_the_last_bit():
    found = intervals_of(VALUES, stretched(DRAWS, UNITS), LIMITS)
    expected = [alone(*each) for each in zip(VALUES, DRAWS.T, UNITS.tolist(), LIMITS, strict=True)]
    assert str(found) == str(expected)
    assert [np.isnan(each.low) for each in found] == [False, False, False, True, True]


@pytest.mark.parametrize("draws", [np.zeros((0, 2)), np.full((9, 2), np.nan)])
def test_without_draws_there_is_no_interval(draws):
    found = intervals_of([0.5, 0.6], stretched(draws, np.array([4, 4])))
    assert [each.value for each in found] == [0.5, 0.6]
    assert np.isnan([end for each in found for end in (each.low, each.high)]).all()
