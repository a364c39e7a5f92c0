"""Divisions: what is scored apart, be it regions of cells as they were counted, or windows of one kind."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.scores.metrics.metric import Metric
from semgrid_eval.scores.regions.partition import Partition
from semgrid_eval.scores.regions.table import PARTITIONS

WindowNumbers = Callable[[Row, Result], NDArray[np.int64]]
"""Numbers the kind of each window of a result: (N,), -1 where it is unknown."""


@dataclass(frozen=True)
class Division:
    """What is scored apart: names of its regions, and how to get what a metric counted in them.

    `shown` is what a report shows of it: columns by metric; where it is empty, each metric's own choice. `sums` returns
    what a metric counted for a result, (N, regions, ...), None where the result does not tell.
    """

    name: str  # in files and columns
    regions: Sequence[str]
    words: str  # what the regions hold, to follow "IoU"
    shown: Mapping[str, Sequence[str]]
    sums: Callable[[Row, Result, Metric], NDArray[np.int32] | None]

    def columns(self, metric: Metric) -> Sequence[str]:
        """Return the columns of a metric that a report shows."""
        return self.shown.get(metric.name, () if self.shown else metric.shown)


def of_cells(partition: Partition) -> Division:
    """Divide by where cells lie, as they were counted."""
    p = partition
    return Division(p.name, p.regions, p.words, p.shown, lambda _, result, metric: result.read(metric.name, p.name))


def of_windows(
    name: str, kinds: Sequence[str], words: str, shown: Mapping[str, Sequence[str]], number: WindowNumbers
) -> Division:
    """Divide by kinds of windows, all of whose cells count."""

    def sums(row: Row, result: Result, metric: Metric) -> NDArray[np.int32] | None:
        everywhere = result.read(metric.name, "all")
        kind = number(row, result)
        if everywhere is None or (kind < 0).all():
            return None
        inside = (kind[:, None] == np.arange(len(kinds))).astype(np.int32)
        found: NDArray[np.int32] = everywhere * inside.reshape(*inside.shape, *(1,) * len(metric.shape))
        return found

    return Division(name, kinds, words, shown, sums)


EVERYWHERE = of_cells(PARTITIONS["all"])
