"""What a run kept of the logs behind its windows: pictures, the drive, and how to find a window again."""

import shlex
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

from semgrid_eval.errors import ResultError
from semgrid_eval.report.reading import Result, Row
from semgrid_eval.scores.pictures import LogPictures, pictures_file, read_pictures
from semgrid_eval.scores.results import WindowRecord, read_run

_EPOCH_FROM_NS = 10**17  # stamps beyond 1973 are dates, smaller ones are times since the start of a log
_LOGS_KEPT = 64  # in memory


class Glimpses:
    """What one run kept of its logs.

    Raises:
        InputError: the run's record cannot be read.
    """

    def __init__(self, run: Path) -> None:
        self._run = run
        record = read_run(run)
        self._command = record.command
        self._digests = {(log.path, log.digest) for log in record.logs}
        self._read = lru_cache(_LOGS_KEPT)(self._read_log)

    def of(self, log: str, result: Result) -> LogPictures | None:
        """Return what was kept of a log that a result is scored on, None where that is nothing that can be read."""
        # A log to train on may have the same path in another folder.
        digest = next((digest for digest in result.record.log_digests if (log, digest) in self._digests), None)
        return None if digest is None else self._read(digest, result.grid.camera if result.grid is not None else None)

    def play_command(self, row: Row, window: WindowRecord) -> str:
        """Write the command that plays a window's recording, with the folders that the run's own command names."""
        found = _options(self._command)
        logs = found.get("--validation-logs", found.get("--logs", "LOGS"))
        where = [found.get("--out", "RUN"), row.record.name, "--logs", logs]
        return shlex.join(["semgrid-eval", "play", *where, "--recording", window.recording, "--out", "play.mcap"])

    def _read_log(self, digest: str, camera: str | None) -> LogPictures | None:
        try:
            return read_pictures(pictures_file(self._run, digest, camera))
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


def _options(command: str) -> Mapping[str, str]:
    """Read the options of a run's command line; empty where it is none."""
    try:
        words = shlex.split(command)
    except ValueError:  # it was not written by a shell's rules
        return {}
    if words[:2] != ["semgrid-eval", "run"]:
        return {}
    spread = [part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])]
    return {name: value for name, value in pairwise(spread) if name.startswith("--")}
