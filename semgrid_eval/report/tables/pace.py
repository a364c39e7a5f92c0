"""Scores by how fast the vehicle drives between the newest input and the target.

Who stands needs no alignment, who drives fast needs it most: whether a model has learned the motion shows here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.report.estimates.bootstrap import Scores, score_rows
from semgrid_eval.report.examples.thumbnails import RunThumbnails
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.report.tables.side_by_side import part_differences, part_frame, part_values
from semgrid_eval.report.tables.table import Table
from semgrid_eval.scores.thumbnails import Drive

PACE_EDGES_MPS = (0.5, 4.0, 8.0)
PACES = ("standing", "below 4 m/s", "4 to 8 m/s", "above 8 m/s")
SHOWN = ("static_known", "vehicles")
_KEPT = ("static_known", "small_static", "vehicles", "small_dynamic", "mean_known")


def score_paces(runs: Sequence[Run], rows: Sequence[Row], seed: int) -> dict[str, Scores]:
    """Score rows on the windows of each pace alone; runs that kept nothing of their logs have none.

    A pace is one of `PACES`: speeds between `PACE_EDGES_MPS`, below the first of which a vehicle stands.
    """
    kept = {run.folder: RunThumbnails(run) for run in runs}
    shared: dict[_Key, NDArray[np.int64]] = {}
    for row in rows:
        for result in row.results:
            if _key(row, result) not in shared:
                shared[_key(row, result)] = _paces(result, kept[row.run])
    found: dict[str, Scores] = {}
    for number, name in enumerate(PACES):
        alone = [_of_pace(row, shared, number) for row in rows]
        scores = score_rows([row for row in alone if row.results], np.random.default_rng(seed))
        if scores:
            found[name] = scores
    return found


def rows_without_pace(rows: Sequence[Row], paces: Mapping[str, Scores]) -> list[str]:
    """Name the rows of whose windows nobody knows how the vehicle drove."""
    known = {name for scores in paces.values() for name in scores}
    return [row.name for row in rows if row.name not in known]


def pace_tables(paces: Mapping[str, Scores]) -> dict[str, Table | None]:
    """Show scores by pace side by side, and the paired differences of rows to their baselines alike."""
    values = "IoU by the vehicle's speed from newest input to target, with 95% interval. Best of each in bold."
    differences = "Differences to the baseline by speed, resampled together. Marked where the interval excludes zero."
    return {
        "paces": part_values("paces", values, paces, SHOWN),
        "pace_differences": part_differences("pace-differences", differences, paces, SHOWN),
    }


def pace_frame(paces: Mapping[str, Scores]) -> pd.DataFrame:
    """Return one line for each pace, row and score, with the paired difference to the row's baseline."""
    return part_frame(paces, "pace", _KEPT)


def mean_speed_mps(drive: Drive, from_ns: int, to_ns: int) -> float:
    """Return the speed at which the straight way between two times is driven."""
    x_m, y_m = (np.interp([from_ns, to_ns], drive.track_ns, drive.track[:, axis]) for axis in (0, 1))
    return float(np.hypot(x_m[1] - x_m[0], y_m[1] - y_m[0]) / ((to_ns - from_ns) * 1e-9))


def _paces(result: Result, kept: RunThumbnails) -> NDArray[np.int64]:
    """Number the pace of each window: (N,), -1 where nothing is known of the drive."""
    found = np.full(len(result.record.windows), -1, np.int64)
    for i, window in enumerate(result.record.windows):
        drive, newest_ns = kept.drive(window.log, result), max(window.input_stamps_ns, default=window.target_stamp_ns)
        if drive is not None and len(drive.track_ns) and newest_ns < window.target_stamp_ns:
            found[i] = np.digitize(mean_speed_mps(drive, newest_ns, window.target_stamp_ns), PACE_EDGES_MPS)
    return found


_Key = tuple[Path, str, bool]


def _key(row: Row, result: Result) -> _Key:
    """Tell windows apart: those of one id are the same, but results of older versions lack the times of inputs."""
    return row.run, result.record.windows_id, any(window.input_stamps_ns for window in result.record.windows)


def _of_pace(row: Row, paces: Mapping[_Key, NDArray[np.int64]], number: int) -> Row:
    """Take a row's windows of one pace alone; results without any are left out."""
    chosen = (each.of_windows(paces[_key(row, each)] == number, each.counts) for each in row.results)
    return replace(row, results=tuple(result for result in chosen if len(result.counts)))
