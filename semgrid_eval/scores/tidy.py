"""A run as data frames of one line for each number, made result by result."""

from collections.abc import Hashable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.scores.metrics.metric import Metric, Partition, column_names
from semgrid_eval.scores.metrics.table import METRICS, metrics_of
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.scores.results import ResultRecord, read_result, read_run, result_folder
from semgrid_eval.scores.sums import read_sums

FIGURE_COLUMNS = ("row", "seed", "metric", "division", "region", "column", "value", "cells", "windows")
WINDOW_COLUMNS = ("row", "seed", "recording", "window", "metric", "division", "region", "ratio")


class _Counted(NamedTuple):
    """What one metric counted by one partition in the windows of one result."""

    row: str
    record: ResultRecord
    metric: Metric
    partition: Partition
    sums: NDArray[np.int32]

    def keyed(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Say in a frame what its numbers belong to."""
        seed = pd.array([self.record.seed] * len(frame), dtype="Int64")
        return frame.assign(row=self.row, seed=seed, metric=self.metric.name, division=self.partition.name)


def load_figures(
    run: Path, *, metrics: Sequence[str] | None = None, partitions: Sequence[str] | None = None
) -> pd.DataFrame:
    """Return every figure of a run, pooled over the windows of a result: `FIGURE_COLUMNS`.

    Metrics and partitions are names of `METRICS` and `PARTITIONS`, all by default.

    Raises:
        InputError: the run or a result of it cannot be read.
    """
    frames = [_figures(counted) for counted in _counted(run, metrics, partitions)]
    whole = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=list(FIGURE_COLUMNS))
    return whole.astype({"seed": "Int64", "value": "float64", "cells": "int64", "windows": "int64"})


def tidy(
    run: Path, *, metrics: Sequence[str] | None = None, partitions: Sequence[str] | None = None
) -> Iterator[pd.DataFrame]:
    """Go through what was counted in every window: `WINDOW_COLUMNS`, numerator and denominator, a frame at a time.

    Both can be summed over windows, recordings and seeds; divided, they are the figure of those.

    Raises:
        InputError: the run or a result of it cannot be read.
    """
    for counted in _counted(run, metrics, partitions):
        ratios = counted.metric.ratios(counted.sums.astype(np.int64))  # (N, regions, K, 2)
        frame = _product(window=range(len(ratios)), region=counted.partition.regions, ratio=counted.metric.ratio_names)
        recordings = np.array([window.recording for window in counted.record.windows])
        frame = counted.keyed(frame.assign(recording=recordings[frame.window]))[list(WINDOW_COLUMNS)]
        yield frame.assign(numerator=ratios[..., 0].ravel(), denominator=ratios[..., 1].ravel())


def windows_with(sums: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Tell in which windows and regions anything was counted: (N, regions, ...) -> (N, regions)."""
    return np.asarray(sums.reshape(*sums.shape[:2], -1).any(axis=2))


def _counted(run: Path, metrics: Sequence[str] | None, partitions: Sequence[str] | None) -> Iterator[_Counted]:
    for asked, table, what in ((metrics, METRICS, "metric"), (partitions, PARTITIONS, "partition")):
        if unknown := [name for name in asked or () if name not in table]:
            raise InputError(f"{unknown[0]!r} is not one of {', '.join(table)}", field=what)
    for row in read_run(run).rows:
        for result_id in row.results:
            folder = result_folder(run, result_id)
            record = read_result(folder)
            known = metrics_of(record.classes)
            for metric, partition in product(metrics or METRICS, partitions or PARTITIONS):
                if (sums := read_sums(folder, metric, partition, record.classes)) is not None:
                    yield _Counted(row.name, record, known[metric], PARTITIONS[partition], sums)


def _figures(counted: _Counted) -> pd.DataFrame:
    metric, sums = counted.metric, counted.sums.sum(axis=0, dtype=np.int64)
    frame = _product(region=counted.partition.regions, column=column_names(metric))
    windows = np.repeat(windows_with(counted.sums).sum(axis=0), len(metric.columns))
    values, cells = metric.figures(metric.ratios(sums)).ravel(), metric.cells(sums).ravel()
    return counted.keyed(frame.assign(value=values, cells=cells, windows=windows))[list(FIGURE_COLUMNS)]


def _product(**levels: Sequence[Hashable]) -> pd.DataFrame:
    """Return a line for each combination of the levels' values, the last level running fastest."""
    return pd.MultiIndex.from_product([*levels.values()], names=[*levels]).to_frame(index=False)
