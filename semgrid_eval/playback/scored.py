"""What `play` and exports read of a run: a row's scored windows with one seed, and the logs that they are from."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError, LogError, ResultError
from semgrid_eval.faults import meant
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.scores import results

_LISTED_NAMES = 10
_CERTAIN = 255


@dataclass(frozen=True)
class Scored:
    """A row's windows with one seed: inputs (N, S, T, H, W); target, mask, prediction and certainty (N, H, W).

    Of a stream, `arrays` are those of the one recording that it keeps, as `results.read_stream` has them.
    """

    row: results.RowRecord
    record: results.ResultRecord
    grid: GridConfig
    arrays: dict[str, NDArray[np.uint8]]

    @cached_property
    def windows_of(self) -> dict[str, list[int]]:
        """Indices of each recording's windows in the order of time; recordings in the order of their first windows."""
        windows = self.record.windows
        found: dict[str, list[int]] = {window.recording: [] for window in windows}
        for i in sorted(range(len(windows)), key=lambda i: windows[i].target_stamp_ns):
            found[windows[i].recording].append(i)
        return found

    @cached_property
    def is_unsure(self) -> bool:
        """Whether the model says how sure it is: one that answers with classes alone is certain of every cell."""
        return bool((self.arrays["certainty"] != _CERTAIN).any())

    def log_of(self, recording: str) -> str:
        """Return the path of a recording's log below the folder of logs."""
        return self.record.windows[self.windows_of[recording][0]].log

    @property
    def kept(self) -> list[str]:
        """Names of the recordings of which grids are kept, in the order of their first windows."""
        return [self.record.windows[0].recording] if self.record.stream else list(self.windows_of)


def find_row(record: results.RunRecord, name: str, run: Path) -> results.RowRecord:
    """Find a row of a run; an InputError says that there is none, or that it has no result."""
    row = next((row for row in record.rows if row.name == name), None)
    if row is None:
        names = [row.name for row in record.rows]
        raise InputError(f"there is no row {name!r}, only {_listed(names)}{meant(name, names)}", path=run)
    if not row.results:
        raise InputError(
            f"it has no result: {row.failure or row.skipped or results.NOT_RUN}", path=run, field=f"row {name}"
        )
    return row


def read_scored(run: Path, row: results.RowRecord) -> Scored:
    """Read the first of a row's results that kept its predictions.

    Raises:
        InputError: none did, or the row is a stream.
        ResultError: what was kept is damaged.
    """
    if row.facts.stream is not None:
        raise InputError("is a stream and has no windows; `play --stream` shows it", path=run, field=f"row {row.name}")
    record, grid, folder = _first_with(results.PREDICTIONS_FILE, run, row)
    arrays = results.read_predictions(folder) | results.read_windows(run, record.windows_id)
    flat = (len(record.windows), grid.spec.rows, grid.spec.columns)
    for name, array in arrays.items():
        expected = (flat[0], len(row.facts.sensors), row.facts.inputs, *flat[1:]) if name == "inputs" else flat
        if array.shape != expected:
            raise ResultError(f"has shape {array.shape}, not {expected}", path=folder, field=name)
    return Scored(row, record, grid, {name: array.astype(np.uint8) for name, array in arrays.items()})


def read_streamed(run: Path, row: results.RowRecord) -> Scored:
    """Read what the first of a stream's results that kept some grids has kept.

    Raises:
        InputError: none did, or the row is not a stream.
        ResultError: what was kept is damaged.
    """
    if row.facts.stream is None:
        raise InputError("is scored window by window and has no stream to play", path=run, field=f"row {row.name}")
    record, grid, folder = _first_with(results.STREAM_FILE, run, row)
    arrays = results.read_stream(folder)
    size = (grid.spec.rows, grid.spec.columns)
    for name in ("prediction", "certainty", "target", "mask"):
        if arrays[name].shape[1:] != size:
            raise ResultError(f"has shape {arrays[name].shape}, not {size}", path=folder, field=name)
    return Scored(row, record, grid, arrays)


def _first_with(file: str, run: Path, row: results.RowRecord) -> tuple[results.ResultRecord, GridConfig, Path]:
    folders = [results.result_folder(run, result_id) for result_id in row.results]
    folder = next((folder for folder in folders if (folder / file).is_file()), None)
    if folder is None:
        raise InputError("none of its results kept its predictions", path=run, field=f"row {row.name}")
    record = results.read_run(run).shown(results.read_result(folder))
    return record, parse_config(GridConfig, record.config.get("grid"), path=folder / "result.json"), folder


def require_alike(rows: Sequence[Scored]) -> None:
    """Make sure that rows can be played side by side.

    Raises:
        InputError: their targets are not grids of the same kind.
    """
    first = rows[0]
    for other in rows[1:]:
        if other.grid.target_identity() != first.grid.target_identity():
            fault = f"its targets are other grids than those of {first.row.name}; play them one by one"
            raise InputError(fault, field=f"row {other.row.name}")


def choose_recordings(rows: Sequence[Scored], recording: str | None, *, every_recording: bool) -> list[str]:
    """Name the recordings that are asked for, the first that all rows have if none is.

    Raises:
        InputError: there is no such recording.
    """
    first, *others = rows
    names = [name for name in first.kept if all(name in other.kept for other in others)]
    wanted = names[:1] if recording is None else [recording]
    if not names or wanted[0] not in names:
        kind = "kept" if first.record.stream else "scored"
        which = "" if recording is None else f" {recording!r}"
        fault = f"there is no {kind} recording{which}, only {_listed(names) or 'others for each row'}"
        raise InputError(fault, field=f"row {', '.join(each.row.name for each in rows)}")
    return names if every_recording else wanted


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _LISTED_NAMES
    return ", ".join(names[:_LISTED_NAMES]) + (f" and {more} more" if more > 0 else "")


def open_scored_log(record: results.RunRecord, scored: Scored, name: str, logs: Path, stack: ExitStack) -> LogReader:
    """Open the log of a recording; a LogError says that it is not the one that was scored."""
    if not logs.is_dir():
        raise InputError("is not a folder", path=logs)
    path = scored.log_of(name)
    log = stack.enter_context(LogReader(logs / path))
    known = results.scored_digest(record, scored.record, path)
    if log.digest not in (scored.record.log_digests if known is None else (known,)):
        raise LogError(f"has digest {log.digest}, and the log that was scored had {known or 'another'}", path=log.path)
    return log
