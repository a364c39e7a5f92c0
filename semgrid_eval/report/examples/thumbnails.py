"""What a run kept of the logs behind its windows: pictures, the drive, and how to find a window again."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import TypeVar

from semgrid_eval.errors import ResultError
from semgrid_eval.report.page.commands import play_command
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.scores.results import WindowRecord, scored_digest
from semgrid_eval.scores.thumbnails import Drive, LogPictures, pictures_file, read_drive, read_pictures

_EPOCH_FROM_NS = 10**17  # stamps beyond 1973 are dates, smaller ones are times since the start of a log
_LOGS_KEPT = 64  # in memory
T = TypeVar("T")


class RunThumbnails:
    """What one run kept of its logs."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._read = lru_cache(_LOGS_KEPT)(partial(self._kept, read_pictures))
        self._read_drive = cache(partial(self._kept, read_drive))
        self._digests: dict[tuple[str, Path], str | None] = {}

    def of(self, log: str, result: Result) -> LogPictures | None:
        """Return what was kept of a log that a result is scored on, None where that is nothing that can be read."""
        key = self._key(log, result)
        return None if key is None else self._read(*key)

    def drive(self, log: str, result: Result) -> Drive | None:
        """Return the drive of such a log alone; all that are asked for stay in memory."""
        key = self._key(log, result)
        return None if key is None else self._read_drive(*key)

    def command(self, row: Row, window: WindowRecord) -> str:
        """Write the command that plays a window's recording."""
        return play_command(self._run.record.command, row.record.name, window.recording)

    def _key(self, log: str, result: Result) -> tuple[str, str | None] | None:
        asked = (log, result.folder)
        if asked not in self._digests:
            self._digests[asked] = scored_digest(self._run.record, result.record, log)
        digest = self._digests[asked]
        return None if digest is None else (digest, None if result.grid is None else result.grid.camera)

    def _kept(self, read: Callable[[Path], T], digest: str, camera: str | None) -> T | None:
        try:
            return read(pictures_file(self._run.folder, digest, camera))
        except ResultError:
            return None


def times(stamp_ns: int, kept: LogPictures | None) -> tuple[str, ...]:
    """Write a time in the forms that viewers take: nanoseconds, seconds, since the log's start, and as a date."""
    seconds = f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"
    since = () if kept is None else (f"{(stamp_ns - kept.drive.start_ns) / 1e9:.3f} s into the log",)
    date = () if stamp_ns < _EPOCH_FROM_NS else (shown_date(stamp_ns),)
    return (f"{stamp_ns} ns", f"{seconds} s", *since, *date)


def shown_date(stamp_ns: int) -> str:
    """Write a time stamp as a date."""
    return f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S}.{stamp_ns % 10**9 // 10**6:03d} UTC"
