"""How far certainty can be trusted: shares of right cells by certainty, and the expected calibration error."""

from typing import NamedTuple

import numpy as np

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.scores.metrics.metric import Column, Counts, Floats, Metric, Regions, ScoredWindows, divided

LEVELS = 256
"""Certainties are kept as uint8, 255 = 1."""
BINS = 10
_FULL = LEVELS - 1


class Reliability(NamedTuple):
    """Cells in bins of certainty of equal width, from 0 to 1; NaN where a bin has none."""

    certainty: Floats  # (..., bins) mean of the bin's cells
    right: Floats  # (..., bins) share of them that are right
    cells: Counts  # (..., bins)


class Calibration(Metric):
    """Cells that are predicted to be known, in bins of certainty: cells, right ones and their levels of certainty.

    Cells that are left unknown would drown all others. To keep those of them that the target knows would keep the
    wrong ones alone, and make an honest model look overconfident. The error of a resample is that of the cells and
    that of the draw, both counted as positive: its interval may lie above the value of a model that has hardly any.
    """

    name = "calibration"
    title = "Calibration on cells predicted to be known (noise only adds to the error, so its intervals lie high)"
    columns = (
        Column("calibration_error", "Expected error (lower is better)", "lower"),
        Column("precision", "Right"),
        Column("certainty", "Mean certainty", ""),
    )
    shown = ("calibration_error", "precision", "certainty")

    def __init__(self, bins: int = BINS) -> None:
        self.bins, self.shape = bins, (bins, 3)
        self.ratio_names = tuple(f"{kind}_{i}" for i in range(bins) for kind in ("right", "certainty"))
        place = np.minimum(np.arange(LEVELS) * bins // _FULL, bins - 1)
        self._bin_of = (place[:, None] == np.arange(bins)).astype(np.int64)  # (levels, bins)

    def count(self, scored: ScoredWindows, regions: Regions) -> Counts:
        """Count cells, right cells and summed levels (255 = 1) in each bin: -> (N, regions, bins, 3)."""
        right = scored.prediction == scored.target
        codes = np.where(scored.prediction == UNKNOWN, -1, scored.certainty.astype(np.int64) * 2 + right)
        found = regions.tally(codes, 2 * LEVELS).reshape(len(codes), regions.count, LEVELS, 2)
        cells = found.sum(axis=-1)
        parts = (cells, found[..., 1], cells * np.arange(LEVELS))
        return np.stack([part @ self._bin_of for part in parts], axis=-1)

    def ratios(self, sums: Counts) -> Counts:
        """Right cells over cells, and summed certainty over cells, for each bin."""
        cells, right, levels = np.moveaxis(sums, -1, 0)
        pairs = np.stack([np.stack([right, cells], -1), np.stack([levels, cells * _FULL], -1)], -2)
        return pairs.reshape(*cells.shape[:-1], 2 * self.bins, 2)

    def figures(self, ratios: Counts) -> Floats:
        """Expected calibration error, share of right cells and mean certainty.

        The error is the mean distance between certainty and share of right cells, weighted by cells.
        """
        bins = self.reliability(ratios)
        gaps = np.nan_to_num(np.abs(bins.certainty - bins.right)) * bins.cells
        error = divided(gaps.sum(axis=-1), bins.cells.sum(axis=-1))
        total = ratios.reshape(*ratios.shape[:-2], self.bins, 2, 2).sum(axis=-3)
        right, certainty = (divided(total[..., i, 0], total[..., i, 1]) for i in (0, 1))
        return np.stack([error, right, certainty], axis=-1)

    def cells(self, sums: Counts) -> Counts:
        """Count the cells of all bins."""
        return np.repeat(sums[..., 0].sum(axis=-1)[..., None], len(self.columns), axis=-1)

    def reliability(self, ratios: Counts) -> Reliability:
        """Divide bin by bin: (..., K, 2) -> (..., bins)."""
        pairs = ratios.reshape(*ratios.shape[:-2], self.bins, 2, 2)
        right, certainty = (divided(pairs[..., i, 0], pairs[..., i, 1]) for i in (0, 1))
        return Reliability(certainty, right, pairs[..., 0, 1])
