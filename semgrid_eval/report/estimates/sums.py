"""What a metric counted for a row, summed by recording as soon as it is read."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.estimates.division import Division
from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.scores.metrics.metric import Counts, Metric
from semgrid_eval.scores.tidy import pooled, windows_with


@dataclass(frozen=True)
class ResultSums:
    """What a metric counted for one result.

    Args:
        result: the result.
        recordings: (R,) names.
        ratios: (R, regions, K, 2) numerators and denominators by recording.
        totals: (regions, *shape) sums over windows.
        windows: (regions,) windows with something to count.
        seen: (R, regions) whether there is something to count.
    """

    result: Result
    recordings: NDArray[np.str_]
    ratios: Counts
    totals: Counts
    windows: NDArray[np.int64]
    seen: NDArray[np.bool_]


@dataclass(frozen=True)
class RegionSums:
    """What a metric counted for a row's results in one region; `groups` names the group of each recording seen."""

    parts: tuple[ResultSums, ...]
    number: int
    groups: dict[str, str]

    @property
    def results(self) -> tuple[Result, ...]:
        """The S results that know the region."""
        return tuple(part.result for part in self.parts)

    @property
    def windows(self) -> int:
        """The windows that have something to count in the region."""
        return max((int(part.windows[self.number]) for part in self.parts), default=0)

    @property
    def totals(self) -> Counts:
        """Sums over windows: (S, *shape)."""
        return np.stack([part.totals[self.number] for part in self.parts])

    def by_recording(self, names: Sequence[str]) -> Counts:
        """Sums in the order of the given recordings: (R, S, K, 2)."""
        ratios = self.parts[0].ratios.shape[2:]
        found = np.zeros((len(names), len(self.parts), *ratios), np.int64)
        index = {name: at for at, name in enumerate(names)}
        for seed, part in enumerate(self.parts):
            mine = np.flatnonzero(part.seen[:, self.number])
            found[[index[name] for name in part.recordings[mine].tolist()], seed] = part.ratios[mine, self.number]
        return found


@dataclass(frozen=True)
class RowSums:
    """What a metric counted for all results of a row in all regions of a division."""

    parts: tuple[ResultSums, ...]
    groups: dict[str, str]

    def region(self, number: int) -> RegionSums:
        """Take one region alone."""
        seen = {name for part in self.parts for name in part.recordings[part.seen[:, number]].tolist()}
        return RegionSums(self.parts, number, {name: self.groups[name] for name in seen})


def row_sums(row: Row, metric: Metric, division: Division) -> RowSums:
    """Read what a metric counted for a row's results, those left out that do not know the regions."""
    counted = ((result, division.sums(row, result, metric)) for result in row.results)
    parts = tuple(_result_sums(result, sums, metric) for result, sums in counted if sums is not None and len(sums))
    logs = {drive: log for result in row.results for drive, log in result.log_of.items()}
    return RowSums(parts, {drive: row.groups.get(log) or drive for drive, log in logs.items()})


def _result_sums(result: Result, sums: NDArray[np.int32], metric: Metric) -> ResultSums:
    recordings, owner = result.recordings
    order = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[order], np.arange(len(recordings)))
    seen = windows_with(sums)
    summed = np.add.reduceat(sums[order], starts, axis=0, dtype=np.int64)
    any_seen = np.logical_or.reduceat(seen[order], starts, axis=0)
    return ResultSums(result, recordings, metric.ratios(summed), pooled(sums), seen.sum(axis=0), any_seen)
