"""Answers that were made elsewhere: which prediction in which log of a folder answers which window or time."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import digest_value
from semgrid_eval.grids.extent import extent_of
from semgrid_eval.log.predictions import GridExtent, PredictionLog
from semgrid_eval.log.store import find_logs
from semgrid_eval.models.model import AnswersIn
from semgrid_eval.runs.row import Row
from semgrid_eval.streams.plan import StreamPlan
from semgrid_eval.streams.schedule import Recorded, Times
from semgrid_eval.windows.data import WindowSet
from semgrid_eval.windows.grids import GridData
from semgrid_eval.windows.lead import period_ns
from semgrid_eval.words import plural

Grids = NDArray[np.uint8]
_LIMIT_BYTES = 8 << 30  # of the grids of one log in memory
_CERTAIN = 255
_LONGEST_LEAD_NS = 60_000_000_000
_LATEST_NS = 1 << 62  # so that a delay can be added


class PredictionLogs:
    """The logs of a folder by the recordings that they belong to; the grids of the last one asked for are kept.

    Raises:
        InputError: the folder holds no log, a log cannot be read, or two belong to one recording.
    """

    def __init__(self, where: AnswersIn, extent: GridExtent) -> None:
        self.folder, self._topic, self._extent = Path(where.folder), where.topic, extent
        self._paths: dict[str, Path] = {}
        self._digests: dict[str, str] = {}
        for path in find_logs(self.folder):
            with PredictionLog(path, where.topic) as log:
                if other := self._paths.get(log.recording):
                    raise InputError(f"{other.name} and {path.name} both belong to {log.recording}", path=self.folder)
                self._paths[log.recording], self._digests[log.recording] = path, log.digest
        self._times: dict[str, Recorded] = {}
        self._kept: tuple[str, Grids] | None = None

    def path(self, recording: str) -> Path:
        """Return the log of a recording.

        Raises:
            InputError: there is none.
        """
        if recording not in self._paths:
            raise InputError(f"no log of predictions belongs to the recording {recording}", path=self.folder)
        return self._paths[recording]

    def digest(self, recordings: Iterable[str]) -> str:
        """Digest all that the logs of some recordings hold."""
        for name in (names := sorted(set(recordings))):
            self.path(name)
        return digest_value([self._topic, *((name, self._digests[name]) for name in names)])

    def times(self, recording: str) -> Recorded:
        """Return the times of all predictions of a recording in the order of its log.

        Raises:
            InputError: there is no log, or it is not one of predictions of these grids; see `PredictionLog`.
        """
        if recording not in self._times:
            with PredictionLog(self.path(recording), self._topic) as log:
                found = [(each.capture_ns, each.for_ns, each.publish_ns) for each in log.predictions(self._extent)]
            self._times[recording] = Recorded(*np.array(found, np.int64).T)
        return self._times[recording]

    def grids(self, recording: str) -> Grids:
        """Return class ids and certainty of all predictions of a recording: (K, 2, H, W).

        Raises:
            LogError: they are too many for memory, or the log is another one than before.
        """
        if self._kept is None or self._kept[0] != recording:
            self._kept = recording, self._read(recording)
        return self._kept[1]

    def _read(self, recording: str) -> Grids:
        count, (rows, columns, *_) = len(self.times(recording).for_ns), self._extent
        path = self.path(recording)
        if count * rows * columns * 2 > _LIMIT_BYTES:
            raise LogError(
                f"holds {plural(count, 'prediction')}, more than {_LIMIT_BYTES >> 30} GiB of them", path=path
            )
        found = np.full((count, 2, rows, columns), _CERTAIN, np.uint8)
        with PredictionLog(path, self._topic) as log:
            if log.digest != self._digests[recording]:
                raise LogError("has changed while it was read", path=path)
            for (classes, certainty), each in zip(found, log.predictions(self._extent), strict=True):
                classes[:] = each.classes
                if each.certainty is not None:
                    certainty[:] = each.certainty
        return found


@dataclass(frozen=True)
class LoggedAnswers:
    """The answers of N windows, read recording by recording."""

    logs: PredictionLogs
    recordings: Sequence[str]  # (N,)
    numbers: NDArray[np.int64]  # (N,) place of each in its recording's log

    def __getitem__(self, chosen: Tensor | slice, /) -> Tensor:
        """Return class ids and their certainty of the chosen windows: (B, 2, H, W) uint8."""
        places = np.arange(len(self.numbers))[chosen if isinstance(chosen, slice) else chosen.cpu().numpy()]
        return torch.from_numpy(np.stack([self.logs.grids(self.recordings[i])[self.numbers[i]] for i in places]))


class RecordedRows:
    """The rows whose answers lie in logs; each folder is looked through once."""

    def __init__(self) -> None:
        self._logs: dict[object, PredictionLogs] = {}

    def of(self, row: Row) -> PredictionLogs | None:
        """Return the logs with a row's answers; None for rows that answer here."""
        if row.answers_in is None:
            return None
        key = (row.answers_in, extent := extent_of(row.grid.spec, row.grid.classes))
        if key not in self._logs:
            self._logs[key] = PredictionLogs(row.answers_in, extent)
        return self._logs[key]

    def identity(self, row: Row, scored: WindowSet) -> dict[str, object]:
        """Return what determines a row's answers besides itself: the content of the logs with them."""
        logs = self.of(row)
        return {"predictions": logs.digest(_owners(scored))} if logs else {}

    def told(self, row: Row, scored: WindowSet, stream: StreamPlan | None) -> LoggedAnswers | None:
        """Find the answers of a row's windows, or of its stream; None for rows that answer here.

        Raises:
            InputError: there are none, or not for each window.
        """
        if (logs := self.of(row)) is None:
            return None
        numbers = _numbers_of(logs, scored) if stream is None else stream.numbers
        return LoggedAnswers(logs, _owners(scored), numbers)


def recorded_times(logs: PredictionLogs, data: GridData, added_ns: int, recording: str) -> Recorded:
    """Return the times of a recording's predictions, each published so much later.

    Raises:
        InputError: one has nothing to do with the recording's frames.
    """
    found, stamps_ns = logs.times(recording), _stamps_ns(data, recording)
    _require_covered(found, stamps_ns, logs.path(recording))
    return found._replace(publish_ns=np.minimum(found.publish_ns, _LATEST_NS) + added_ns)


def _require_covered(found: Recorded, stamps_ns: Times, path: Path) -> None:
    """Refuse predictions from other times than the recording's; for a minute after its end, they were made in it."""
    first_ns, last_ns = int(stamps_ns[0]), int(stamps_ns[-1])
    near_ns = period_ns(stamps_ns) // 2
    until_ns = {"capture_time": last_ns + near_ns, "timestamp": last_ns + _LONGEST_LEAD_NS}
    for name, times_ns in (("capture_time", found.capture_ns), ("timestamp", found.for_ns)):
        outside = (times_ns < first_ns - near_ns) | (times_ns > until_ns[name])
        if outside.any():
            reach = f"the recording goes from {first_ns} to {last_ns} ns"
            raise LogError(f"{times_ns[outside.argmax()]} ns, where no truth is: {reach}", path=path, field=name)


def _numbers_of(logs: PredictionLogs, windows: WindowSet) -> NDArray[np.int64]:
    """Find the prediction of each window: for its target's time, by inputs up to its newest; of several the newest.

    Raises:
        InputError: a window has none.
    """
    data, owners = windows.data, _owners(windows)
    newest_ns = data.stamps_ns[windows.inputs[:, -1].cpu().numpy()]
    target_ns = data.stamps_ns[windows.target_frames.cpu().numpy()]
    times = cache(partial(recorded_times, logs, data, 0))
    numbers, missing = np.zeros(len(owners), np.int64), list[int]()
    for place, (name, by_ns, for_ns) in enumerate(zip(owners, newest_ns, target_ns, strict=True)):
        found = times(name)
        fitting = np.flatnonzero(
            (np.abs(found.for_ns - for_ns) <= period_ns(_stamps_ns(data, name)) // 2) & (found.capture_ns <= by_ns)
        )
        if len(fitting):
            away_ns = np.abs(found.for_ns[fitting] - for_ns)
            numbers[place] = fitting[np.lexsort((fitting, -away_ns, found.capture_ns[fitting]))[-1]]
        else:
            missing.append(place)
    if missing:
        first = missing[0]
        fault = f"nothing for {target_ns[first]} ns by inputs up to {newest_ns[first]} ns"
        more = f"; in all, {len(missing)} of {len(owners)} windows miss theirs"
        raise LogError(fault + more, path=logs.path(owners[first]), field=f"recording {owners[first]}")
    return numbers


def _owners(windows: WindowSet) -> list[str]:
    """Name the recording of each window."""
    owners, _ = windows.data.locate(windows.inputs[:, -1].cpu().numpy())
    return [windows.data.recordings[owner] for owner in owners]


def _stamps_ns(data: GridData, recording: str) -> Times:
    index = data.recordings.index(recording)
    return data.stamps_ns[data.first_frames[index] : data.first_frames[index + 1]]
