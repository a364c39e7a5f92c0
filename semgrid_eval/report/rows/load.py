"""Reads a run's result files; what cannot be read becomes a failure of its row, and the rest goes on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, SemgridError
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores.results import (
    NOT_RUN,
    PREDICTIONS_FILE,
    ResultRecord,
    RowRecord,
    RunRecord,
    WindowRecord,
    read_counts,
    read_history,
    read_result,
    read_run,
    result_folder,
)

WindowReader = Callable[[Path, str], Mapping[str, NDArray[Any]]]
"""Reads a set of windows, as `scores.results.read_windows` does, from a run by its id."""


@dataclass(frozen=True)
class Result:
    """One readable result: its record, the counts (N, C, C) of its windows and its training history.

    `regions` holds the counts near moving and near standing actors alone; it is empty where no log has the truth.
    """

    record: ResultRecord
    counts: NDArray[np.int32]
    regions: Mapping[str, NDArray[np.int32]]
    history: pd.DataFrame | None
    folder: Path

    @cached_property
    def grid(self) -> GridConfig | None:
        """How its grids were made, None where it does not tell."""
        try:
            return parse_config(GridConfig, self.record.config["grid"])
        except (KeyError, ConfigError):
            return None

    def of_windows(self, used: NDArray[np.bool_], counts: NDArray[np.int32]) -> "Result":
        """Return the result of the windows marked in `used` (N,) alone, with their part of other counts (N, C, C)."""
        windows = tuple(window for window, kept in zip(self.record.windows, used, strict=True) if kept)
        return replace(self, counts=counts[used], record=self.record.model_copy(update={"windows": windows}))

    @property
    def spec(self) -> GridSpec:
        """The extent of its grids, the default one where it does not tell."""
        return GridSpec() if self.grid is None else self.grid.spec

    @cached_property
    def settings(self) -> Mapping[str, Any]:
        """All that determined it, nested settings under dotted names: `network.depth`."""
        return _flat(self.record.config)

    @cached_property
    def places(self) -> Mapping[tuple[str, int], int]:
        """The index of each window by `key_of`."""
        return {key_of(window): i for i, window in enumerate(self.record.windows)}


@dataclass(frozen=True)
class Row:
    """One row of the matrix with its readable results, in the order of its record, and what went wrong."""

    name: str  # unique in the report: the record's name, with its run's tag where there are several runs
    record: RowRecord
    results: tuple[Result, ...]
    failures: tuple[str, ...]
    run: Path

    @property
    def is_left(self) -> bool:
        """Whether its turn has not come, or it was not asked for."""
        return not self.results and not self.failures

    @property
    def is_baseline(self) -> bool:
        """Whether other rows are measured against this one."""
        return self.record.facts.baseline

    @property
    def learns(self) -> bool:
        """Whether its model was fitted to training windows."""
        return self.record.facts.learns

    @property
    def targets(self) -> str:
        """The comparability key of its results; empty where there is none."""
        return self.results[0].record.targets if self.results else ""

    @property
    def shown(self) -> Result:
        """The result to show pictures of: the first one that kept its predictions."""
        kept = (result for result in self.results if (result.folder / PREDICTIONS_FILE).is_file())
        return next(kept, self.results[0])

    @property
    def window_set(self) -> tuple[Path, str]:
        """The run and id of the shown result's set of windows, which rows may share."""
        return self.run, self.shown.record.windows_id

    @property
    def windows(self) -> int:
        """Windows behind the row's scores."""
        return max((len(result.counts) for result in self.results), default=0)

    @property
    def window_ms(self) -> tuple[float, ...]:
        """The mean time of a window's prediction by result."""
        return tuple(1000 * result.record.predict_seconds / self.windows for result in self.results)


@dataclass(frozen=True)
class Run:
    """A whole run as read from disk."""

    folder: Path
    tag: str  # tells runs apart; empty where there is only one
    record: RunRecord
    rows: tuple[Row, ...]


def load_runs(folders: Sequence[Path], *, progress: Progress = silent) -> tuple[Run, ...]:
    """Read the records of runs and every row's results.

    Raises:
        InputError: a run's record is missing or malformed. Faulty results are failures of their rows instead.
    """
    records = [read_run(folder) for folder in folders]
    total, done, runs = sum(len(record.rows) for record in records), 0, []
    for folder, tag, record in zip(folders, _tags(folders), records, strict=True):
        rows = []
        for row in record.rows:
            rows.append(_load_row(folder, row, f"{row.name} ({tag})" if tag else row.name))
            done += 1
            progress(done, total, row.name)
        runs.append(Run(folder, tag, record, tuple(rows)))
    return tuple(runs)


def key_of(window: WindowRecord) -> tuple[str, int]:
    """Identify the target frame of a window across rows."""
    return window.recording, window.target_stamp_ns


def _flat(config: Mapping[str, object], prefix: str = "") -> dict[str, Any]:
    """Flatten nested settings to dotted names."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found


def _tags(folders: Sequence[Path]) -> list[str]:
    """Name runs by their folders where that tells them apart, else by number."""
    if len(folders) < 2:
        return [""] * len(folders)
    names = [folder.resolve().name for folder in folders]
    return names if len(set(names)) == len(names) else [f"run {i}" for i in range(1, len(folders) + 1)]


def _load_row(run: Path, row: RowRecord, name: str) -> Row:
    failures = [] if row.failure in (None, NOT_RUN) else [row.failure]
    found = []
    for result_id in row.results:
        try:
            found.append(_load_result(result_folder(run, result_id)))
        except (SemgridError, OSError, ValueError) as error:
            failures.append(str(error))
    if not row.results and row.failure is None:
        failures.append("it has no result")
    if found and not any(len(result.counts) for result in found):
        failures.append("it has no window to score")
    return Row(name, row, tuple(found), tuple(failures), run)


def _load_result(folder: Path) -> Result:
    record, (counts, near) = read_result(folder), read_counts(folder)
    if len(counts) != len(record.windows):
        raise ValueError(f"{folder / 'counts.npz'}: {len(counts)} windows, but result.json has {len(record.windows)}")
    if counts.min(initial=0) < 0 or counts.sum(axis=(1, 2)).max(initial=0) > np.iinfo(np.int32).max // CLASS_COUNT:
        raise ValueError(f"{folder / 'counts.npz'}: counts are negative or beyond any grid")
    regions = {name: values.astype(np.int32) for name, values in near.items()}
    return Result(record, counts.astype(np.int32), regions, read_history(folder), folder)
