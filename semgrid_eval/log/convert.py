"""Convert recordings to logs, several at once: what is done is skipped, what fails is named, the rest goes on."""

import errno
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NoReturn, Self

from semgrid_eval.errors import InputError, LogError, SemgridError
from semgrid_eval.executors import Executor, InProcess, WorkerDied, local_executor
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import SUFFIX, write_log
from semgrid_eval.places import remove_stale
from semgrid_eval.progress import Stage, silent_stage
from semgrid_eval.recording.types import Recording

_DISK_FULL = (errno.ENOSPC, errno.EDQUOT)


@dataclass(frozen=True)
class Work:
    """How a conversion is carried out; none of it changes what is written."""

    workers: int = 1  # processes of this machine at once
    executor: Executor | None = None  # where recordings are converted; by default in those processes
    cache: Path | None = None  # folder of what a source keeps beside the logs; by default in the folder of the logs
    stage: Stage = silent_stage  # shows progress


IN_PROCESS = Work()


@dataclass(frozen=True)
class ConversionJob:
    """One recording to convert; it travels to another process, so `digest` and `load` must be picklable."""

    name: str  # of the recording, a valid file name without suffix
    split: str  # the folder its log goes to
    digest: str | Callable[[], str]  # of all that determines the content, or what computes it (in the other process)
    load: Callable[[], Recording]  # returns the recording

    @classmethod
    def failing(cls, name: str, split: str, fault: str) -> Self:
        """Stand for a recording of which it is known beforehand why it fails."""
        refuse = partial(_refuse, fault)
        return cls(name, split, refuse, refuse)

    @property
    def label(self) -> str:
        """Split and name, which nothing else in a conversion shares."""
        return f"{self.split}/{self.name}"


@dataclass
class ConversionSummary:
    """What became of each recording, by split and name (`val/aachen_000000_000000`), sorted."""

    written: list[str] = field(default_factory=list)  # new logs
    skipped: list[str] = field(default_factory=list)  # logs that are up to date
    failed: dict[str, str] = field(default_factory=dict)  # reasons
    all_splits: bool = False  # these are all recordings of all splits: no other log belongs beside theirs
    remark: str = ""  # what else the source has to say, one line
    warning: str = ""  # what seems wrong with the logs, one line

    @property
    def labels(self) -> set[str]:
        """Split and name of all recordings."""
        return {*self.written, *self.skipped, *self.failed}


def convert_recordings(recordings: Iterable[Recording], out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the log OUT/<split>/<name>.mcap of each recording, as `convert_jobs` does, one after the other.

    They need not be picklable, so they stay in this process; a source whose recordings take long makes jobs of them.
    """
    jobs = [ConversionJob(each.name, each.split, each.source_digest, partial(_itself, each)) for each in recordings]
    return convert_jobs(jobs, out, replace(work, executor=InProcess()))


def convert_jobs(
    jobs: Sequence[ConversionJob], out: Path, work: Work = IN_PROCESS, *, label: str = "convert"
) -> ConversionSummary:
    """Write the log OUT/<split>/<name>.mcap of each job's recording.

    A log that is whole and was made from inputs of the same digest is left as it is. A recording that fails, because
    its source is at fault, is named in the summary with its reason.

    Raises:
        InputError: two recordings have one name, or the disk is full.
    """
    for label_of_job, count in Counter(job.label for job in jobs).items():
        if count > 1:
            raise InputError("two recordings have this name", field=label_of_job)
    summary = ConversionSummary()
    remove_stale(out)
    executor = work.executor or local_executor(work.workers)
    with work.stage(label) as progress:
        for done, (index, outcome) in enumerate(executor.run(partial(_convert, out=out), jobs), start=1):
            _note(outcome, jobs[index].label, summary)
            progress(done, len(jobs), jobs[index].label)
    summary.written.sort()
    summary.skipped.sort()
    summary.failed = dict(sorted(summary.failed.items()))
    return summary


@dataclass(frozen=True)
class _Outcome:
    written: bool
    failure: str | None = None
    disk_full: bool = False


def _note(outcome: _Outcome | WorkerDied, label: str, summary: ConversionSummary) -> None:
    if isinstance(outcome, WorkerDied):
        summary.failed[label] = outcome.reason
    elif outcome.disk_full:
        raise InputError(f"{outcome.failure}; what is written is whole: make room, and the same command continues")
    elif outcome.failure is not None:
        summary.failed[label] = outcome.failure
    else:
        (summary.written if outcome.written else summary.skipped).append(label)


def how_to_label(out: Path) -> str:
    """Say, at the end of a source's remark, how logs without label images get them."""
    return f"add them with semgrid-eval segment {out} --model NETWORK.onnx --out LABELLED"


def _convert(job: ConversionJob, out: Path) -> _Outcome:
    path = out / job.split / f"{job.name}{SUFFIX}"
    try:
        digest = job.digest if isinstance(job.digest, str) else job.digest()
        if _is_current(path, digest):
            return _Outcome(written=False)
        write_log(job.load(), path)
    except (SemgridError, OSError) as error:  # OSError: of a file that the source did not find
        stale = f" (the log of an earlier conversion stays: {path})" if path.exists() else ""
        cause = error.__cause__
        disk_full = isinstance(cause, OSError) and cause.errno in _DISK_FULL  # every further log would fail alike
        return _Outcome(written=False, failure=f"{error}{stale}", disk_full=disk_full)
    return _Outcome(written=True)


def _refuse(fault: str) -> NoReturn:
    raise InputError(fault)


def _itself(recording: Recording) -> Recording:
    return recording


def _is_current(path: Path, digest: str) -> bool:
    """Whether the log is there, whole and made from inputs of this digest."""
    try:
        with LogReader(path) as log:
            if log.scene.source_digest != digest or log.recovered():  # a conversion can give all that was lost
                return False
            log.verify()
    except LogError:
        return False
    return True
