"""Result files: what a run leaves on disk and all that a report reads.

```
RUN/run.json                   RunRecord: provenance, logs, rows and, for each row, its results by id
RUN/results/<id>/result.json   ResultRecord
RUN/results/<id>/counts.npz    counts (N, C, C) int64, [target, prediction], mask M left out; where a log has the truth
                               counts_moving and counts_standing alike: cells near moving actors, or near standing
                               ones alone. Near is within a cell of the footprint at the target's time, or of the
                               footprint in an input, moved by the ego motion, where a repeated input has its ghost
RUN/results/<id>/history.csv   of trained models: epoch, updates, learning_rate, loss, validation_loss, seconds
RUN/results/<id>/predictions.npz   prediction (N, H, W) uint8 class ids, certainty (N, H, W) uint8 (255 = 1.0)
RUN/windows/<id>.npz           inputs (N, S, T, H, W) uint8 aligned, target (N, H, W) uint8, mask (N, H, W) bool;
                               where a log has the truth actors (N, H, W) uint8: 1 near a standing actor, 2 near a
                               moving one, 3 near both, zeros for windows of logs without the truth
RUN/pictures/<key>.npz         small camera and label images of the windows' frames, see `scores.pictures`
```
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.files import read_json, write_json

FORMAT_VERSION = 1
PREDICTIONS_FILE = "predictions.npz"
HISTORY_FILE = "history.csv"
NOT_RUN = "not run yet"
"""What the record of a row says whose turn has not come."""
REGIONS = ("moving", "standing")
"""Where counts are kept apart: near actors that move, and near those that stand."""


class LogRecord(Config):
    """A log that took part in a run; its path is below the folder of logs.

    Its group is the town, city or drive that it belongs to; empty where it stands for itself.
    """

    name: str
    path: str
    digest: str
    split: str
    dataset: str
    group: str = ""
    fingerprint: str | None = None  # of a benchmark's log: what is compared with the published ones


class WindowRecord(Config):
    """One scored window: its recording, the index of its target frame there and that frame's time."""

    recording: str
    log: str
    target_frame: int
    target_stamp_ns: int
    input_stamps_ns: tuple[int, ...] = ()  # oldest first; results of older versions have none

    @property
    def drive(self) -> str:
        """The recording without the number of its stretch: stretches of one log are not independent of each other."""
        return re.sub(r"#\d+$", "", self.recording)


class RowFacts(Config):
    """What a row is, whatever it is called: differences, pairs, curves and examples are formed by this alone.

    Args:
        model: as the matrix names it: `ed`, `fuse`, `mine.py:Mine`.
        family: of models, which figures draw alike: `ED`, `BL`, or that of a model of one's own.
        learns: whether it was fitted to training windows, by counts or by gradient.
        baseline: whether other rows are measured against it.
        inputs: grids of the past, by sensor.
        step_frames: frames between inputs.
        horizon_steps: steps from the newest input to the target.
        sensors: names of the inputs' sensors.
        translate: whether inputs are moved into the target's place.
    """

    model: str
    family: str
    learns: bool
    baseline: bool
    inputs: int
    step_frames: int
    horizon_steps: int
    sensors: tuple[str, ...]
    translate: bool


class ResultRecord(Config):
    """One scored predictor with one seed.

    Args:
        targets: digest of target windows, of what makes their grids, mask mode and split. Results are subtracted from
            each other only where it is equal.
        lead_s: median time from the newest input to the target.
    """

    format_version: int
    id: str
    facts: RowFacts
    targets: str
    lead_s: float
    config: dict[str, object]
    log_digests: tuple[str, ...]
    seed: int | None  # None: the predictor does not depend on chance
    windows_id: str  # names RUN/windows/<windows_id>.npz
    windows: tuple[WindowRecord, ...]
    device: str
    train_seconds: float | None
    predict_seconds: float
    parameters: int | None


class RowRecord(Config):
    """One row of the matrix; a failed row has a reason instead of results."""

    facts: RowFacts
    name: str  # unique in the run, e.g. "ED-DC"
    experiment: str  # "DC", "NT", "Sp2", "PH3", ...
    model: str  # "ED", "BL", ...
    label: str  # for readers: name and what it does
    inputs: int
    step_frames: int
    horizon_steps: int
    sensors: tuple[str, ...]
    translate: bool
    results: tuple[str, ...] = ()
    failure: str | None = None


class RunRecord(Config):
    """A whole run: what was asked, with what, and where each row's results lie."""

    format_version: int
    title: str
    command: str
    matrix: dict[str, object]
    versions: dict[str, str]
    machine: dict[str, str]
    started: str  # ISO 8601, UTC
    seconds: float
    logs: tuple[LogRecord, ...]
    failed_logs: dict[str, str]  # log path -> reason
    rows: tuple[RowRecord, ...]


def run_file(run: Path) -> Path:
    """Where the record of a run lies."""
    return run / "run.json"


def result_folder(run: Path, result_id: str) -> Path:
    """Where a result lies."""
    return run / "results" / result_id


def scored_digest(run: RunRecord, result: ResultRecord, path: str) -> str | None:
    """Find the digest of the log at a path that a result was scored on, None where the run does not tell.

    A log to train on may have the same path in another folder; of the two, the one to score is recorded last.
    """
    found = [log.digest for log in run.logs if log.path == path and log.digest in result.log_digests]
    return found[-1] if found else None


def windows_file(run: Path, windows_id: str) -> Path:
    """Where a set of windows lies."""
    return run / "windows" / f"{windows_id}.npz"


def write_run(run: Path, record: RunRecord) -> None:
    """Write a run's record atomically."""
    write_json(run_file(run), record.model_dump(mode="json"))


def read_run(run: Path) -> RunRecord:
    """Read a run's record.

    Raises:
        InputError: it is missing, malformed or of another format version.
    """
    if not run_file(run).is_file():
        raise ResultError("no run lies here (it has no run.json)", path=run)
    record = parse_config(RunRecord, read_json(run_file(run)), path=run_file(run))
    _check_version(record.format_version, run_file(run))
    return record


def read_result(folder: Path) -> ResultRecord:
    """Read a result's record and check that it belongs to its folder.

    Raises:
        InputError: it is missing, malformed, of another format version or under another id's name.
    """
    path = folder / "result.json"
    record = parse_config(ResultRecord, read_json(path), path=path)
    _check_version(record.format_version, path)
    if record.id != folder.name:
        raise ResultError(f"belongs to another folder than {folder.name}", path=path, field="id")
    return record


def write_result(folder: Path, record: ResultRecord) -> None:
    """Write a result's record."""
    write_json(folder / "result.json", record.model_dump(mode="json"))


def is_done(folder: Path, *, with_predictions: bool = False, with_history: bool = False) -> bool:
    """Tell whether a result parses, matches its id, has counts of the right shape, and what else is asked for."""
    try:
        counts, _ = read_counts(folder)
        if with_predictions:
            read_predictions(folder)
        if with_history and ((history := read_history(folder)) is None or history.empty):
            return False
        return len(counts) == len(read_result(folder).windows)
    except (InputError, OSError, ValueError):
        return False


def read_windows(run: Path, windows_id: str) -> dict[str, NDArray[Any]]:
    """Read `inputs` (moved to the target's time, also for rows that saw them not moved), `target` and `mask`.

    Raises:
        ResultError: they are missing or damaged.
    """
    return read_arrays(windows_file(run, windows_id), ("inputs", "target", "mask"))


def read_predictions(folder: Path) -> dict[str, NDArray[Any]]:
    """Read what a result predicted: `prediction` and `certainty`.

    Raises:
        ResultError: they are missing or damaged.
    """
    return read_arrays(folder / PREDICTIONS_FILE, ("prediction", "certainty"))


def write_counts(folder: Path, counts: NDArray[np.int64], region_counts: dict[str, NDArray[np.int64]]) -> None:
    """Write the confusion counts (N, C, C) of a result, and those of regions by their names in `REGIONS`."""
    regions = {f"counts_{name}": region_counts[name] for name in REGIONS if name in region_counts}
    write_arrays(folder / "counts.npz", {"counts": counts, **regions})


def read_counts(folder: Path) -> tuple[NDArray[np.int64], dict[str, NDArray[np.int64]]]:
    """Read the confusion counts (N, C, C) of a result: of all cells, and near `moving` and `standing` actors.

    The latter are empty where no log had the truth.

    Raises:
        ResultError: they are missing or malformed.
    """
    path = folder / "counts.npz"
    keys = {name: f"counts_{name}" for name in REGIONS}
    found = read_arrays(path, ("counts",), optional=tuple(keys.values()))
    counts = _checked_counts(found["counts"], path, "counts")
    regions = {name: _checked_counts(found[key], path, key) for name, key in keys.items() if key in found}
    for name, near in regions.items():
        if len(near) != len(counts):
            raise ResultError(f"has {len(near)} windows, not {len(counts)}", path=path, field=keys[name])
    return counts, regions


def read_history(folder: Path) -> pd.DataFrame | None:
    """Read the training history of a result, None where nothing was trained."""
    path = folder / HISTORY_FILE
    return pd.read_csv(path) if path.is_file() else None


def _checked_counts(counts: NDArray[Any], path: Path, name: str) -> NDArray[np.int64]:
    if counts.ndim != 3 or counts.shape[1:] != (CLASS_COUNT, CLASS_COUNT) or counts.dtype != np.int64:
        raise ResultError(f"has shape {counts.shape}, type {counts.dtype}", path=path, field=name)
    return counts


def _check_version(found: int, path: Path) -> None:
    if found != FORMAT_VERSION:
        raise ResultError(
            f"{found} is not {FORMAT_VERSION}, which this version reads", path=path, field="format_version"
        )
