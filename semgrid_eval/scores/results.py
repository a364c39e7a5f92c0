"""Result files: what a run leaves on disk and all that a report reads.

```
RUN/run.json                   RunRecord: provenance, logs, rows and, for each row, its results by id
RUN/results/<id>/result.json   ResultRecord
RUN/results/<id>/sums.npz      int32 arrays METRIC.PARTITION (N, regions, ...): what each metric of `scores.metrics`
                               counted in each window, by the regions of a partition of `scores.regions`; `iou.all` is
                               the confusion matrix (N, 1, C, C), [target, prediction], mask M left out. The partition
                               `actors` is there where a log has the truth
RUN/results/<id>/expected.npz  where asked for and known: the same, counted against the target that is measured on
                               average, the likeliest class of each cell over new errors drawn on the exact pictures
RUN/results/<id>/history.csv   of trained models: epoch, updates, learning_rate, loss, validation_loss, seconds
RUN/results/<id>/predictions.npz   prediction (N, H, W) uint8 class ids, certainty (N, H, W) uint8 (255 = 1.0)
RUN/results/<id>/stream.npz    of a stream, of its first recording: the K answers that were used, prediction and
                               certainty (K, H, W) uint8 for the vehicle's place at the time that they are for, with
                               for_ns, capture_ns, publish_ns (K,) and its position then and at publication, answer_m
                               and publish_m (K, 2); of the E times of evaluation evaluated_ns (E,), evaluated_m (E, 2),
                               used (E,) the answer or -1, target and mask M (E, H, W) uint8
RUN/windows/<id>.npz           inputs (N, S, T, H, W) uint8 aligned, target (N, H, W) uint8, mask (N, H, W) bool;
                               where a log has the truth actors (N, H, W) uint8: 1 near a standing actor, 2 near a
                               moving one, 3 near both, zeros for windows of logs without the truth
RUN/pictures/<key>.npz         small camera and label images of the windows' frames, see `scores.thumbnails`
```
"""

import io
import re
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays
from semgrid_eval.class_files import classes_of_grid
from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError, ResultError, first_line
from semgrid_eval.scores.facts import RowFacts, StreamRecord
from semgrid_eval.scores.sums import check_sums
from semgrid_eval.seals import read_sealed, read_sealed_json, write_sealed_json

FORMAT_VERSION = 2
RUN_FILE, RESULT_FILE = "run.json", "result.json"
PREDICTIONS_FILE, STREAM_FILE, HISTORY_FILE = "predictions.npz", "stream.npz", "history.csv"
_ANSWERS = ("prediction", "certainty", "for_ns", "capture_ns", "publish_ns", "answer_m", "publish_m")
_EVALUATIONS = ("evaluated_ns", "evaluated_m", "used", "target", "mask")
_RUN = "run"  # owns the record of a run, which has no id
NOT_RUN = "not run yet"  # what the record of a row says whose turn has not come


class LogRecord(Config):
    """A log that took part in a run; its path is below the folder of logs."""

    name: str
    path: str
    digest: str
    split: str
    dataset: str
    group: str = ""  # the town, city or drive that it belongs to; empty where it stands for itself
    checksums: bool = True  # whether it has them; without, damage cannot be seen
    recovered: str = ""  # of a log that was recovered from a damaged one, what it lost
    fingerprint: str | None = None  # of a benchmark's log: what is compared with the published ones


class WindowRecord(Config):
    """One scored window: its recording, the index of its target frame there and that frame's time."""

    recording: str
    log: str
    target_frame: int
    target_stamp_ns: int
    input_stamps_ns: tuple[int, ...]  # oldest first

    @property
    def drive(self) -> str:
        """The recording without the number of its stretch: stretches of one log are not independent of each other."""
        return re.sub(r"#\d+$", "", self.recording)


class ResultRecord(Config):
    """One scored predictor with one seed.

    `targets` is a digest of target windows, of what makes their grids, mask mode and split. Results are subtracted from
    each other only where it is equal.
    """

    format_version: int
    id: str
    facts: RowFacts
    targets: str
    lead_s: float  # median time from the newest input to the target
    config: dict[str, object]
    log_digests: tuple[str, ...]
    seed: int | None  # None: the predictor does not depend on chance
    windows_id: str  # names RUN/windows/<windows_id>.npz
    windows: tuple[WindowRecord, ...]
    device: str
    train_seconds: float | None
    predict_seconds: float
    parameters: int | None
    stream: StreamRecord | None = None  # then its windows are blocks of time, and the first recording is kept
    has_expected: bool = False  # whether it is also scored against what is measured on average

    @property
    def classes(self) -> ClassSet:
        """The classes of its grids; a ConfigError says that what its configuration has is not a class set."""
        return classes_of_grid(self.config.get("grid"), self.id)


class RowRecord(Config):
    """One row of the matrix; a row that failed, or that these logs cannot have, has a reason instead of results."""

    facts: RowFacts
    name: str  # unique in the run
    label: str  # for readers: name, what it does, and what it is asked
    words: str = ""  # what its model does
    results: tuple[str, ...] = ()
    failure: str | None = None
    skipped: str | None = None  # it asks for a truth that the logs do not hold


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

    @property
    def classes(self) -> ClassSet:
        """The classes of all its rows, in the colours that its matrix had when it was last run."""
        rows = self.matrix.get("rows")
        first = rows[0] if isinstance(rows, list) and rows else None
        return classes_of_grid(first.get("grid") if isinstance(first, dict) else None, f"{RUN_FILE}: matrix")

    def shown(self, result: ResultRecord) -> ResultRecord:
        """Return a result of this run in the run's colours, which may have changed since it was made."""
        grid, classes = result.config.get("grid"), self.classes
        if not isinstance(grid, dict) or classes == result.classes or not classes.means(result.classes):
            return result
        written = {} if classes == DEFAULT_CLASSES else {"classes": classes.model_dump(mode="json")}
        others = {key: value for key, value in grid.items() if key != "classes"}
        return result.model_copy(update={"config": {**result.config, "grid": others | written}})


R = TypeVar("R", RunRecord, ResultRecord)


def result_folder(run: Path, result_id: str) -> Path:
    """Where a result lies."""
    return run / "results" / result_id


def windows_file(run: Path, windows_id: str) -> Path:
    """Where a set of windows lies."""
    return run / "windows" / f"{windows_id}.npz"


def scored_digest(run: RunRecord, result: ResultRecord, path: str) -> str | None:
    """Find the digest of the log at a path that a result was scored on, None where the run does not tell.

    A log to train on may have the same path in another folder; of the two, the one to score is recorded last.
    """
    found = [log.digest for log in run.logs if log.path == path and log.digest in result.log_digests]
    return found[-1] if found else None


def write_run(run: Path, record: RunRecord) -> None:
    """Write a run's record atomically."""
    write_sealed_json(run / RUN_FILE, record.model_dump(mode="json"), _RUN)


def read_run(run: Path) -> RunRecord:
    """Read a run's record; an InputError says that it is missing, malformed or of another format version."""
    if not (run / RUN_FILE).is_file():
        raise ResultError("is not the folder of a run: it has no run.json", path=run)
    return _record(RunRecord, run / RUN_FILE, _RUN)


def write_result(folder: Path, record: ResultRecord) -> None:
    """Write a result's record."""
    write_sealed_json(folder / RESULT_FILE, record.model_dump(mode="json"), record.id)


def read_result(folder: Path) -> ResultRecord:
    """Read a result's record; an InputError says that it is missing, malformed, or of another version or folder."""
    record = _record(ResultRecord, folder / RESULT_FILE, folder.name)
    if record.id != folder.name:
        raise ResultError(f"belongs to another folder than {folder.name}", path=folder / RESULT_FILE, field="id")
    return record


def fault_of(folder: Path, *, with_predictions: bool = False, with_history: bool = False) -> str | None:
    """Say why a result is not done; None where it parses, matches its id and has sums and what else is asked for."""
    try:
        record = read_result(folder)
        check_sums(folder, len(record.windows), record.classes, has_expected=record.has_expected)
        if with_predictions:
            read_stream(folder) if record.stream else read_predictions(folder)
        if with_history and ((history := read_history(folder)) is None or history.empty):
            raise ResultError("is missing or empty", path=folder / HISTORY_FILE)
    except (InputError, OSError, ValueError) as error:
        return first_line(error)
    return None


def is_done(folder: Path, *, with_predictions: bool = False, with_history: bool = False) -> bool:
    """Tell whether a result is done."""
    return fault_of(folder, with_predictions=with_predictions, with_history=with_history) is None


def read_windows(run: Path, windows_id: str) -> dict[str, NDArray[Any]]:
    """Read `inputs` (moved to the target's time, also for rows that saw them not moved), `target` and `mask`.

    Raises:
        ResultError: they are missing or damaged; likewise below.
    """
    return read_arrays(windows_file(run, windows_id), ("inputs", "target", "mask"), owner=windows_id)


def read_predictions(folder: Path) -> dict[str, NDArray[Any]]:
    """Read what a result predicted: `prediction` and `certainty`."""
    return read_arrays(folder / PREDICTIONS_FILE, ("prediction", "certainty"), owner=folder.name)


def read_stream(folder: Path) -> dict[str, NDArray[Any]]:
    """Read what a stream keeps of its first recording: K answers and E times of evaluation."""
    found = read_arrays(folder / STREAM_FILE, (*_ANSWERS, *_EVALUATIONS), owner=folder.name)
    for names in (_ANSWERS, _EVALUATIONS):
        lengths = {name: len(found[name]) for name in names}
        if len(set(lengths.values())) > 1:
            raise ResultError(f"has arrays of different lengths: {lengths}", path=folder / STREAM_FILE)
    return found


def read_history(folder: Path) -> pd.DataFrame | None:
    """Read the training history of a result, None where nothing was trained."""
    path = folder / HISTORY_FILE
    if not path.is_file():
        return None
    return pd.read_csv(io.BytesIO(read_sealed(path, folder.name)), comment="#")


def _record(kind: type[R], path: Path, owner: str) -> R:
    record = parse_config(kind, read_sealed_json(path, owner), path=path)
    if record.format_version != FORMAT_VERSION:
        fault = f"{record.format_version} is not {FORMAT_VERSION}, which this version reads"
        raise ResultError(fault, path=path, field="format_version")
    return record
