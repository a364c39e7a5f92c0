"""What a run kept of the logs behind its windows: pictures, the track, and how to find a window again."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import TypeVar

from semgrid_eval.errors import ResultError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.page.commands import play_command
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.scores.results import WindowRecord, scored_digest
from semgrid_eval.scores.thumbnails import LogPictures, Track, pictures_file, read_pictures, read_track

_EPOCH_FROM_NS = 10**17  # stamps beyond 1973 are dates, smaller ones are times since the start of a log
_LOGS_KEPT = 64  # in memory
T = TypeVar("T")


class RunThumbnails:
    """What one run kept of its logs."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._read = lru_cache(_LOGS_KEPT)(partial(self._kept, read_pictures))
        self._read_track = cache(partial(self._kept, read_track))
        self._files: dict[tuple[str, Path], Path | None] = {}

    def of(self, log: str, result: Result) -> LogPictures | None:
        """Return what was kept of a log that a result is scored on, None where that is nothing that can be read."""
        file = self._file(log, result)
        return None if file is None else self._read(file)

    def track(self, log: str, result: Result) -> Track | None:
        """Return the track of such a log alone; all that are asked for stay in memory."""
        file = self._file(log, result)
        return None if file is None else self._read_track(file)

    def command(self, row: Row, window: WindowRecord) -> str:
        """Write the command that plays a window's recording."""
        return play_command(self._run.record.command, row.record.name, window.recording)

    def _file(self, log: str, result: Result) -> Path | None:
        asked = (log, result.folder)
        if asked not in self._files:
            digest = scored_digest(self._run.record, result.record, log)
            file = None if digest is None else pictures_file(self._run.folder, digest, result.grid or GridConfig())
            self._files[asked] = file
        return self._files[asked]

    @staticmethod
    def _kept(read: Callable[[Path], T], file: Path) -> T | None:
        try:
            return read(file)
        except ResultError:
            return None


def times(stamp_ns: int, kept: LogPictures | None) -> tuple[str, ...]:
    """Write a time in the forms that viewers take: nanoseconds, seconds, since the log's start, and as a date."""
    seconds = f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"
    since = () if kept is None else (f"{(stamp_ns - kept.track.start_ns) / 1e9:.3f} s into the log",)
    date = f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S}.{stamp_ns % 10**9 // 10**6:03d} UTC"
    return (f"{stamp_ns} ns", f"{seconds} s", *since, *((date,) if stamp_ns >= _EPOCH_FROM_NS else ()))
