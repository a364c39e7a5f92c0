"""The divisions that every metric is reported by; among them, windows by how fast the vehicle drives.

Who stands needs no alignment, who drives fast needs it most: whether a model has learned the motion shows here.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.estimates.division import Division, of_cells, of_windows
from semgrid_eval.report.estimates.streams import warm_up
from semgrid_eval.report.examples.thumbnails import RunThumbnails
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.scores.metrics.metric import Metric
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.scores.thumbnails import Track

EDGES_MPS = (0.5, 4.0, 8.0)
"""Speeds between the paces; below the first a vehicle stands."""
PACES = ("standing", "below 4 m/s", "4 to 8 m/s", "above 8 m/s")
_WORDS = "by the vehicle's speed from newest input to target, of streams in each half second"


def paces(runs: Sequence[Run]) -> Division:
    """Divide windows by pace, as far as runs kept what they know of their logs."""
    kept = {run.folder: RunThumbnails(run) for run in runs}
    shared: dict[tuple[Path, str], NDArray[np.int64]] = {}

    def number(row: Row, result: Result) -> NDArray[np.int64]:
        key = (row.run, result.record.windows_id)
        if key not in shared:
            shared[key] = _paces(result, kept[row.run])
        return shared[key]

    return of_windows("paces", PACES, _WORDS, _shown, number)


def _shown(metric: Metric) -> Sequence[str]:
    """Show the background and what moves first."""
    return (metric.compared[1], *metric.moving[:1]) if isinstance(metric, Iou) else ()


def mean_speed_mps(track: Track, from_ns: int, to_ns: int) -> float:
    """Return the speed at which the straight way between two times is driven."""
    to_ns = min(to_ns, int(track.stamps_ns[-1]))  # the last block of a stream ends after its recording
    from_ns = min(from_ns, to_ns - 100_000_000)
    x_m, y_m = (np.interp([from_ns, to_ns], track.stamps_ns, track.poses[:, axis]) for axis in (0, 1))
    return float(np.hypot(x_m[1] - x_m[0], y_m[1] - y_m[0]) / ((to_ns - from_ns) * 1e-9))


def _paces(result: Result, kept: RunThumbnails) -> NDArray[np.int64]:
    """Number the pace of each window: (N,), -1 where nothing is known of the drive."""
    found = np.full(len(result.record.windows), -1, np.int64)
    for i, window in enumerate(result.record.windows):
        track = kept.track(window.log, result)
        if track is not None and len(track.stamps_ns):
            speed_mps = mean_speed_mps(track, window.input_stamps_ns[-1], window.target_stamp_ns)
            found[i] = np.digitize(speed_mps, EDGES_MPS)
    return found


def divisions(runs: Sequence[Run]) -> list[Division]:
    """Return the divisions of cells, all cells first, and then those of windows."""
    return [*map(of_cells, PARTITIONS.values()), paces(runs), warm_up(runs)]  # to add kinds of windows, add them here
