"""Accuracy: the share of the cells that the target knows which are predicted right."""

import numpy as np

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.scores.metrics.metric import Column, Counts, Metric, Regions, ScoredWindows


class Accuracy(Metric):
    """Right and all cells among those that the target knows."""

    name = "accuracy"
    title = "Share of the target's known cells that are predicted right"
    shape = (2,)
    ratio_names = ("right",)
    columns = (Column("right", "Right"),)
    shown = ("right",)

    def count(self, scored: ScoredWindows, regions: Regions) -> Counts:
        """Count wrong and right cells: -> (N, regions, 2)."""
        right = (scored.prediction == scored.target).astype(np.int64)
        return regions.tally(np.where(scored.target == UNKNOWN, -1, right), 2)

    def ratios(self, sums: Counts) -> Counts:
        """Right cells over all of them."""
        return np.stack([sums[..., 1], sums.sum(axis=-1)], axis=-1)[..., None, :]

    def cells(self, sums: Counts) -> Counts:
        """Count the target's known cells."""
        return np.asarray(sums.sum(axis=-1, keepdims=True))
