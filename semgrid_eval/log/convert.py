"""Convert recordings to logs, several at once: what is done is skipped, what fails is named, the rest goes on."""

import errno
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from semgrid_eval.errors import InputError, LogError, SemgridError
from semgrid_eval.executors import Executor, WorkerDied
from semgrid_eval.log.store import SUFFIX, LogReader, write_log
from semgrid_eval.progress import Progress
from semgrid_eval.recording.types import Recording

_DISK_FULL = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class ConversionJob:
    """One recording to convert; it travels to another process, so `digest` and `load` must be picklable.

    Args:
        name: of the recording, a valid file name without suffix.
        split: the folder its log goes to.
        digest: digest of everything that determines the content, or what computes it (in the other process).
        load: gives the recording.
    """

    name: str
    split: str
    digest: str | Callable[[], str]
    load: Callable[[], Recording]

    @property
    def label(self) -> str:
        """Split and name, which nothing else in a conversion shares."""
        return f"{self.split}/{self.name}"


@dataclass
class ConversionSummary:
    """What became of each recording, by split and name (`val/aachen_000000_000000`), sorted."""

    written: list[str] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)


def convert_recordings(
    jobs: Sequence[ConversionJob], out: Path, *, executor: Executor, progress: Progress
) -> ConversionSummary:
    """Write the log OUT/<split>/<name>.mcap of each recording.

    A log that is whole and was made from inputs of the same digest is left as it is. A recording that fails, because
    its source is at fault, is named in the summary with its reason.

    Args:
        jobs: the recordings.
        out: the folder of all logs.
        executor: where recordings are converted.
        progress: told after each recording.

    Raises:
        InputError: two recordings have one name, or the disk is full.
    """
    _refuse_duplicates(jobs)
    summary = ConversionSummary()
    for done, (index, outcome) in enumerate(executor.run(partial(_convert, out=out), jobs), start=1):
        job = jobs[index]
        if isinstance(outcome, WorkerDied):
            summary.failed[job.label] = outcome.reason
        elif outcome.disk_full:
            raise InputError(f"{outcome.failure}; what is written is whole: make room, and the same command goes on")
        elif outcome.failure is not None:
            summary.failed[job.label] = outcome.failure
        else:
            (summary.written if outcome.written else summary.skipped).append(job.label)
        progress(done, len(jobs), job.label)
    summary.written.sort()
    summary.skipped.sort()
    summary.failed = dict(sorted(summary.failed.items()))
    return summary


@dataclass(frozen=True)
class _Outcome:
    written: bool
    failure: str | None = None
    disk_full: bool = False


def _convert(job: ConversionJob, out: Path) -> _Outcome:
    path = out / job.split / f"{job.name}{SUFFIX}"
    try:
        digest = job.digest if isinstance(job.digest, str) else job.digest()
        if _is_current(path, digest):
            return _Outcome(written=False)
        write_log(job.load(), path)
    except SemgridError as error:
        stale = f" (the log of an earlier conversion stays: {path})" if path.exists() else ""
        return _Outcome(written=False, failure=f"{error}{stale}", disk_full=_is_disk_full(error))
    return _Outcome(written=True)


def _is_disk_full(error: SemgridError) -> bool:
    """Whether every further log would fail alike."""
    return isinstance(error.__cause__, OSError) and error.__cause__.errno in _DISK_FULL


def _is_current(path: Path, digest: str) -> bool:
    """Whether the log is there, whole and made from inputs of this digest."""
    if not path.exists():
        return False
    try:
        with LogReader(path) as log:
            if log.scene.source_digest != digest:
                return False
            log.verify()
    except LogError:
        return False
    return True


def _refuse_duplicates(jobs: Sequence[ConversionJob]) -> None:
    seen: set[str] = set()
    for job in jobs:
        if job.label in seen:
            raise InputError("two recordings have this name", field=job.label)
        seen.add(job.label)
