"""Divisions, what is scored apart: regions of cells as they were counted, or windows of one kind; and sums by them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.scores.metrics.metric import Counts, Metric, Partition, Shown
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.scores.tidy import windows_with


@dataclass(frozen=True)
class Division:
    """What is scored apart: names of its regions, and how to get what a metric counted in them.

    `shown` chooses the columns of a metric that a report shows of it. `sums` returns what a metric counted for a
    result, (N, regions, ...), None where the result does not tell.
    """

    name: str  # in files and columns
    regions: Sequence[str]
    words: str  # what the regions hold, to follow "IoU"
    shown: Shown
    sums: Callable[[Row, Result, Metric], NDArray[np.int32] | None]
    by_inputs: bool = False  # whether rows of other inputs have other cells, or windows, in a region


def of_cells(partition: Partition) -> Division:
    """Divide by where cells lie, as they were counted."""

    def sums(_: Row, result: Result, metric: Metric) -> NDArray[np.int32] | None:
        return result.read(metric.name, partition.name)

    names = partition.name, partition.regions, partition.words, partition.shown
    return Division(*names, sums, partition.by_inputs)


def of_windows(
    name: str,
    kinds: Sequence[str],
    words: str,
    shown: Shown,
    number: Callable[[Row, Result], NDArray[np.int64]],
) -> Division:
    """Divide by kinds of windows, all of whose cells count; `number` numbers those of a result: (N,), -1 if unknown."""

    def sums(row: Row, result: Result, metric: Metric) -> NDArray[np.int32] | None:
        everywhere = result.read(metric.name, "all")
        kind = number(row, result)
        if everywhere is None or (kind < 0).all():
            return None
        inside = (kind[:, None] == np.arange(len(kinds))).astype(np.int32)
        found: NDArray[np.int32] = everywhere * inside.reshape(*inside.shape, *(1,) * len(metric.shape))
        return found

    return Division(name, kinds, words, shown, sums, by_inputs=True)


EVERYWHERE = of_cells(PARTITIONS["all"])


@dataclass(frozen=True)
class ResultSums:
    """What a metric counted for one result in one region."""

    result: Result
    recordings: NDArray[np.str_]  # (R,) names of those with something to count
    ratios: Counts  # (R, K, 2) their numerators and denominators
    cells: Counts  # (R, Q) their cells behind each figure
    totals: Counts  # (*shape) sums over windows
    windows: int  # how many have something to count


@dataclass(frozen=True)
class RowSums:
    """What a metric counted in one region for those of a row's results, S, that know the region."""

    parts: tuple[ResultSums, ...]

    @property
    def windows(self) -> int:
        """The windows that have something to count."""
        return max((part.windows for part in self.parts), default=0)

    @property
    def totals(self) -> Counts:
        """Sums over windows: (S, *shape)."""
        return np.stack([part.totals for part in self.parts])

    def units(self, unit_of: Mapping[str, str]) -> Counts:
        """Count the units, recordings or groups of them, that have cells behind each figure: (Q,)."""
        known: dict[str, NDArray[np.bool_]] = {}
        for part in self.parts:
            for name, cells in zip(part.recordings.tolist(), part.cells, strict=True):
                unit = unit_of[name]
                known[unit] = known.get(unit, False) | (cells > 0)
        return np.asarray(np.sum(list(known.values()), axis=0, dtype=np.int64))

    def by_recording(self, names: Sequence[str]) -> Counts:
        """Sums in the order of the given recordings: (R, S, K, 2)."""
        found = np.zeros((len(names), len(self.parts), *self.parts[0].ratios.shape[1:]), np.int64)
        index = {name: at for at, name in enumerate(names)}
        for seed, part in enumerate(self.parts):
            found[[index[name] for name in part.recordings.tolist()], seed] = part.ratios
        return found


def row_sums(row: Row, metric: Metric, division: Division) -> list[RowSums]:
    """Read what a metric counted for a row's results, by region; results that do not know the regions are left out."""
    counted = ((result, division.sums(row, result, metric)) for result in row.results)
    parts = [_by_region(result, sums, metric) for result, sums in counted if sums is not None and len(sums)]
    return [RowSums(tuple(part[number] for part in parts)) for number in range(len(division.regions))]


def _by_region(result: Result, sums: NDArray[np.int32], metric: Metric) -> list[ResultSums]:
    recordings, owner = result.recordings
    order = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[order], np.arange(len(recordings)))
    counted = windows_with(sums)  # (N, regions)
    pooled = np.add.reduceat(sums[order], starts, axis=0, dtype=np.int64)  # (R, regions, *shape)
    ratios, cells = metric.ratios(pooled), metric.cells(pooled)  # (R, regions, K, 2), (R, regions, Q)
    seen, totals = np.logical_or.reduceat(counted[order], starts, axis=0), sums.sum(axis=0, dtype=np.int64)
    return [
        ResultSums(
            result,
            recordings[mine],
            ratios[mine, number],
            cells[mine, number],
            totals[number],
            int(counted[:, number].sum()),
        )
        for number, mine in enumerate(seen.T)
    ]
