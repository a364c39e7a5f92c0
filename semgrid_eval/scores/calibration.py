"""How far certainty can be trusted: shares of right cells by certainty, and the expected calibration error."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN

LEVELS = 256
"""Certainties are kept as uint8, 255 = 1."""

Grid = NDArray[np.uint8]
Counts = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reliability:
    """Cells in bins of certainty of equal width, from 0 to 1.

    Args:
        certainty: (bins,) mean certainty of the bin's cells; NaN where there is none.
        right: (bins,) share of the bin's cells that are right; NaN where there is none.
        cells: (bins,) their number.
    """

    certainty: Floats
    right: Floats
    cells: Counts


def certainty_counts(target: Grid, prediction: Grid, certainty: Grid, mask: NDArray[np.bool_]) -> Counts:
    """Count cells outside M that are predicted to be known, by certainty: (N, H, W) each -> (256, wrong and right).

    Cells that are left unknown would drown all others. To keep those of them that the target knows would keep the
    wrong ones alone, and make an honest model look overconfident.
    """
    counted = ~mask & (prediction != UNKNOWN)
    index = certainty[counted].astype(np.int64) * 2 + (target == prediction)[counted]
    return np.asarray(np.bincount(index, minlength=2 * LEVELS).reshape(LEVELS, 2), np.int64)


def reliability(counts: Counts, bins: int = 10) -> Reliability:
    """Join the levels of `certainty_counts` (256, wrong and right) into bins."""
    levels = np.arange(LEVELS)
    place = np.minimum(levels * bins // (LEVELS - 1), bins - 1)
    total = counts.sum(axis=1)
    cells = np.bincount(place, total, bins).astype(np.int64)
    empty = np.full(bins, np.nan)
    right = np.divide(np.bincount(place, counts[:, 1], bins), cells, out=empty.copy(), where=cells > 0)
    summed = np.bincount(place, total * levels / (LEVELS - 1), bins)
    certainty = np.divide(summed, cells, out=empty.copy(), where=cells > 0)
    return Reliability(np.asarray(certainty), np.asarray(right), cells)


def expected_calibration_error(counts: Counts, bins: int = 10) -> float:
    """Mean distance between certainty and share of right cells over bins, weighted by cells; NaN without any cell."""
    table = reliability(counts, bins)
    used = table.cells > 0
    if not used.any():
        return float("nan")
    return float(np.average(np.abs(table.certainty - table.right)[used], weights=table.cells[used]))
