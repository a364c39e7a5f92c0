"""Reads a run's result files; what cannot be read becomes a failure of its row, and the rest goes on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, ResultError, SemgridError, first_line
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores import results as files
from semgrid_eval.scores.sums import EXPECTED_FILE, check_sums, read_sums
from semgrid_eval.scores.thumbnails import PICTURES, read_faults
from semgrid_eval.seals import read_sealed

WindowReader = Callable[[Path, str], Mapping[str, NDArray[Any]]]
"""Reads a set of windows, as `scores.results.read_windows` does, from a run by its id."""


@dataclass(frozen=True)
class Result:
    """One readable result: its record, its training history, and its sums, which are read when asked for."""

    record: files.ResultRecord
    read: Callable[[str, str], NDArray[np.int32] | None]  # what a metric counted by a partition, as `read_sums` does
    history: pd.DataFrame | None
    folder: Path
    # The same, counted against what is measured on average; None where it is not scored against that.
    read_expected: Callable[[str, str], NDArray[np.int32] | None] | None = None

    @cached_property
    def counts(self) -> NDArray[np.int32]:
        """The confusion counts of all cells by window: (N, C, C)."""
        counts = self.read("iou", "all")
        assert counts is not None  # all cells are always counted
        return counts[:, 0]

    @cached_property
    def classes(self) -> ClassSet:
        """The classes of its grids."""
        return self.record.classes

    @cached_property
    def recordings(self) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
        """The names (R,) of the drives that windows come from, and the index of each window's (N,)."""
        names, owner = np.unique([window.drive for window in self.record.windows], return_inverse=True)
        return names, owner

    @cached_property
    def grid(self) -> GridConfig | None:
        """How its grids were made, None where it does not tell."""
        try:
            return parse_config(GridConfig, self.record.config["grid"])
        except (KeyError, ConfigError):
            return None

    @cached_property
    def settings(self) -> Mapping[str, Any]:
        """All that determined it, nested settings under dotted names: `settings.depth`."""
        return _flat(self.record.config)

    @cached_property
    def places(self) -> Mapping[tuple[str, int], int]:
        """The index of each window by `key_of`."""
        return {key_of(window): i for i, window in enumerate(self.record.windows)}


@dataclass(frozen=True)
class Row:
    """One row of the matrix with its readable results, in the order of its record, and what went wrong."""

    name: str  # unique in the report: the record's name, with its run's tag where there are several runs
    record: files.RowRecord
    results: tuple[Result, ...]
    failures: tuple[str, ...]
    run: Path
    groups: Mapping[str, str] = field(default_factory=dict)  # by a log's path
    faults: tuple[str, ...] = ()  # those of the failures that are faults of its files
    number: int = 0  # its place in the report, counted through all runs from 1

    @property
    def classes(self) -> ClassSet:
        """The classes of its grids; the default ones where it has no result."""
        return self.results[0].classes if self.results else DEFAULT_CLASSES

    @property
    def is_left(self) -> bool:
        """Whether its turn has not come, or it was not asked for."""
        return not (self.results or self.failures or self.is_skipped)

    @property
    def is_skipped(self) -> bool:
        """Whether it asks for a truth that the logs do not hold."""
        return self.record.skipped is not None

    @property
    def is_baseline(self) -> bool:
        """Whether other rows are measured against this one."""
        return self.record.facts.baseline

    @property
    def uses_truth(self) -> bool:
        """Whether it is told of the truth, so that it is a line beside the others and never the best."""
        return self.record.facts.uses_truth

    @cached_property
    def group_of(self) -> Mapping[str, str]:
        """The group that each drive belongs to: a town, city or drive, by default the drive itself."""
        windows = (window for result in self.results for window in result.record.windows)
        return {window.drive: self.groups.get(window.log) or window.drive for window in windows}

    @property
    def disturbed(self) -> str:
        """What is wrong with its inputs, in words; empty where nothing is."""
        return self.record.facts.disturbed

    @property
    def is_stream(self) -> bool:
        """Whether it is scored as its answers come; then its windows are blocks of time."""
        return self.record.facts.stream is not None

    @property
    def is_oracle(self) -> bool:
        """Whether it is a stream that nobody has: it knows when answers will be used, or its model takes no time."""
        how = self.record.facts.stream
        return how is not None and (how.asked in ("known", "exact") or how.model_is_free)

    @property
    def targets(self) -> str:
        """The comparability key of its results; empty where there is none."""
        return self.results[0].record.targets if self.results else ""

    @property
    def question(self) -> tuple[object, ...]:
        """What it is asked: targets, sensors, number of inputs, their step, horizon, translation and disturbance."""
        f = self.record.facts
        ahead = f.step_frames, f.horizon_steps, f.lead_ms
        return self.targets, f.sensors, f.inputs, ahead, f.translate, f.disturbed

    @property
    def shown(self) -> Result:
        """The result to show pictures of: the first one that kept its predictions."""
        kept = (result for result in self.results if (result.folder / files.PREDICTIONS_FILE).is_file())
        return next(kept, self.results[0])

    @property
    def window_set(self) -> tuple[Path, str]:
        """The run and id of the shown result's set of windows, which rows may share."""
        return self.run, self.shown.record.windows_id

    @property
    def windows(self) -> int:
        """Windows behind the row's scores."""
        return max((len(result.record.windows) for result in self.results), default=0)

    @property
    def window_ms(self) -> tuple[float, ...]:
        """The mean time of a window's prediction by result."""
        return tuple(1000 * result.record.predict_seconds / self.windows for result in self.results)


class Fault(NamedTuple):
    """Something in a run's folder that is damaged, lost or belongs elsewhere: its kind, its name and what is wrong."""

    kind: str
    name: str
    reason: str


@dataclass(frozen=True)
class Run:
    """A whole run as read from disk."""

    folder: Path
    tag: str  # tells runs apart; empty where there is only one
    record: files.RunRecord
    rows: tuple[Row, ...]
    faults: tuple[Fault, ...] = ()  # of files besides those of the rows' scores
    damaged_pictures: tuple[str, ...] = ()  # of logs, as the run found them

    @property
    def damages(self) -> tuple[Fault, ...]:
        """All that is wrong with the run's files."""
        return (*(Fault("row", row.name, reason) for row in self.rows for reason in row.faults), *self.faults)


def load_runs(folders: Sequence[Path], *, progress: Progress = silent) -> tuple[Run, ...]:
    """Read the records of runs and every row's results.

    Raises:
        InputError: a run's record is missing or malformed. Faulty results are failures of their rows instead.
    """
    records = [files.read_run(folder) for folder in folders]
    total, done, runs = sum(len(record.rows) for record in records), count(1), []
    for folder, tag, record in zip(folders, _tags(folders), records, strict=True):
        rows, load = [], _Loader(folder, record)
        for row in record.rows:
            rows.append(load.row(row, f"{row.name} ({tag})" if tag else row.name, number := next(done)))
            progress(number, total, row.name)
        runs.append(Run(folder, tag, record, tuple(rows), *_besides_scores(folder, rows)))
    return tuple(runs)


def _besides_scores(run: Path, rows: Sequence[Row]) -> tuple[tuple[Fault, ...], tuple[str, ...]]:
    """Look at what a report's examples are made from: what is wrong with its files, and what a run found in logs."""
    results = [result for row in rows for result in row.results]
    asked = {
        files.windows_file(run, result.record.windows_id): "windows"
        for result in results
        if result.record.stream is None
    }
    for file, kind in ((files.PREDICTIONS_FILE, "predictions"), (files.STREAM_FILE, "stream")):
        kept = (result.folder / file for result in results)
        asked |= {path: kind for path in kept if path.exists()}
    faults, said = [], list[str]()
    for path, kind in asked.items():
        owner = path.stem if kind == "windows" else path.parent.name
        try:
            read_sealed(path, owner)
        except ResultError as error:
            faults.append(_fault(kind, path, error, run))
    for path in sorted((run / PICTURES).glob("*.npz")):
        try:
            said += read_faults(path)
        except ResultError as error:
            faults.append(_fault("pictures", path, error, run))
    return tuple(faults), tuple(said)


def _fault(kind: str, path: Path, error: ResultError, run: Path) -> Fault:
    return Fault(kind, str(path.relative_to(run)), str(error).removeprefix(f"{path}: "))


def comparable(row: Row, other: Row) -> bool:
    """Tell whether rows may be subtracted: both have results, and these have the same targets, in whichever runs."""
    return row.targets == other.targets != ""


def key_of(window: files.WindowRecord) -> tuple[str, int]:
    """Identify the target frame of a window across rows."""
    return window.recording, window.target_stamp_ns


def _flat(config: Mapping[str, object], prefix: str = "") -> dict[str, Any]:
    """Flatten nested settings to dotted names."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        found |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return found


def _tags(folders: Sequence[Path]) -> list[str]:
    """Name runs by their folders where that tells them apart, else by number."""
    if len(folders) < 2:
        return [""] * len(folders)
    names = [folder.resolve().name for folder in folders]
    return names if len(set(names)) == len(names) else [f"run {i}" for i in range(1, len(folders) + 1)]


class _Loader:
    """Reads the rows of one run; results that have the same windows share the records of them."""

    def __init__(self, run: Path, record: files.RunRecord) -> None:
        self._run, self._record = run, record
        self._groups = {log.path: log.group for log in record.logs}
        self._windows: dict[tuple[files.WindowRecord, ...], tuple[files.WindowRecord, ...]] = {}

    def row(self, row: files.RowRecord, name: str, number: int) -> Row:
        failures = [] if row.failure in (None, files.NOT_RUN) else [row.failure]
        found, faults = [], []
        for result_id in row.results:
            try:
                found.append(self._result(files.result_folder(self._run, result_id)))
            except (SemgridError, OSError, ValueError) as error:
                faults.append(first_line(error))
        failures += faults
        if not row.results and row.failure is None and row.skipped is None:
            failures.append("it has no result")
        if found and not any(result.record.windows for result in found):
            failures.append("it has no window to score")
        return Row(name, row, tuple(found), tuple(failures), self._run, self._groups, tuple(faults), number)

    def _result(self, folder: Path) -> Result:
        record = self._record.shown(files.read_result(folder))
        windows = self._windows.setdefault(record.windows, record.windows)
        check_sums(folder, len(windows), record.classes, has_expected=record.has_expected)
        shared = record.model_copy(update={"windows": windows})
        expected = None
        if record.has_expected:
            expected = partial(read_sums, folder, classes=record.classes, file=EXPECTED_FILE, verify=False)
        sums = partial(read_sums, folder, classes=record.classes, verify=False)
        return Result(shared, sums, files.read_history(folder), folder, expected)
