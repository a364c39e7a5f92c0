"""Works off a matrix: plans its distinct units, hands them to an executor, and keeps the record of the run."""

import datetime
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import torch

from semgrid_eval.errors import ConfigError, SemgridError, first_line
from semgrid_eval.executors import Executor, InProcess, NoRoomError, WorkerDied
from semgrid_eval.files import digest_value
from semgrid_eval.models.device import choose_device, keep_freed_memory
from semgrid_eval.progress import Progress, Stage, silent, silent_stage
from semgrid_eval.runs.matrix import Matrix, Row
from semgrid_eval.runs.provenance import machine, versions
from semgrid_eval.runs.sources import Sources
from semgrid_eval.runs.thumbnails import keep_pictures
from semgrid_eval.runs.unit import Worker, identity
from semgrid_eval.scores import results
from semgrid_eval.windows.data import WindowSet


@dataclass(frozen=True)
class RunOptions:
    """How a matrix is run; but for the logs to score, nothing here changes its numbers on one machine.

    Args:
        device: `auto`, `cpu`, `cuda`, `cuda:1`, ...
        grids: folder in which grids are kept.
        command: how the run was started, for the record.
        only: names or patterns of the rows to work on, all where it is empty; what others have is kept on record.
        executor: where rows are trained and scored.
        grid_executor: where grids are built and pictures made small.
        validation_logs: folder of the logs to score, where they are not among those to train on.
        trainings: folder of the trainings, the run's own if not given; what another run has trained is found there.
        pictures: whether to keep small pictures of the windows' frames for the report.
    """

    device: str
    grids: Path
    command: str
    only: tuple[str, ...] = ()
    executor: Executor = field(default_factory=InProcess)
    grid_executor: Executor = field(default_factory=InProcess)
    pictures: bool = True
    validation_logs: Path | None = None
    trainings: Path | None = None


class Unit(NamedTuple):
    """A row with one seed; `seed` is None where nothing is trained."""

    row: Row
    seed: int | None


class Outcome(NamedTuple):
    """What became of a unit: the id of its result, or the reason why there is none."""

    result_id: str | None
    failure: str | None
    left_out: dict[str, str]  # logs that gave no window, and why


def plan_units(matrix: Matrix) -> dict[str, Unit]:
    """List the distinct units of a matrix by key; rows that mean the same share them."""
    units: dict[str, Unit] = {}
    for row in matrix.rows:
        for key, unit in units_of(row, matrix.seed):
            units.setdefault(key, unit)
    return units


def run_matrix(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, *, stage: Stage = silent_stage
) -> results.RunRecord:
    """Train and score every row; what is done already is kept, a row that fails is noted and the rest goes on.

    Raises:
        InputError: there is no log at all, or the device does not exist.
        ConfigError: `options.only` asks for a row that the matrix does not have.
    """
    started = _Clock()
    units = plan_units(matrix)
    wanted = wanted_keys(matrix, options.only)
    worker = make_worker(matrix, logs, out, options, stage)
    for sources in worker.sources:
        sources.prepare()
        sources.identify()
    outcomes: dict[str, Outcome] = {}

    def look_for_others() -> None:
        for key, unit in units.items():
            if key not in outcomes and key not in wanted and (found := _finished(worker, unit)):
                outcomes[key] = found

    def keep_record() -> results.RunRecord:
        record = _record(matrix, options.command, started, worker, outcomes)
        results.write_run(out, record)  # a run that is stopped can be reported as far as it came
        return record

    look_for_others()
    keep_record()
    if options.pictures:
        rows = wanted_rows(matrix, options.only)
        keep_pictures(out, _scored_windows(worker, rows), options.grid_executor, stage)
    keys = [key for key in units if key in wanted]
    with _unit_work(matrix, logs, out, options, worker, stage) as (work, progress):
        progress(0, len(keys))
        for done, (index, outcome) in enumerate(options.executor.run(work, [units[key] for key in keys]), start=1):
            outcomes[keys[index]] = Outcome(None, outcome.reason, {}) if isinstance(outcome, WorkerDied) else outcome
            keep_record()
            progress(done, len(keys))
    look_for_others()  # another run may have worked on the same folder
    return keep_record()


def _scored_windows(worker: Worker, rows: Iterable[Row]) -> Iterator[tuple[WindowSet, str | None]]:
    """Return the windows of rows that have some, and the camera that they show."""
    for row in rows:
        with suppress(SemgridError, torch.OutOfMemoryError):  # its units will tell
            yield worker.scored_windows(row)[0], row.grid.camera


def make_worker(matrix: Matrix, logs: Path, out: Path, options: RunOptions, stage: Stage) -> Worker:
    """Make a worker for the units of a matrix; it builds or reads grids when they are asked for.

    Raises:
        InputError: there is no log at all, or the device does not exist.
    """
    keep_freed_memory()
    device = choose_device(options.device)
    # Where others do the work, the grids here need no room on the device.
    place = device if options.executor.parallel == 1 else torch.device("cpu")
    source = partial(
        Sources, cache=options.grids, rows=matrix.rows, executor=options.grid_executor, device=place, stage=stage
    )
    scored = source(options.validation_logs) if options.validation_logs else None
    return Worker(
        out,
        source(logs),
        device,
        matrix.seed,
        stage,
        scored_sources=scored,
        trainings=options.trainings,
        threads=options.executor.threads,
    )


class _Clock:
    """When a run started."""

    def __init__(self) -> None:
        self.utc = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        self._start_s = time.monotonic()

    def seconds(self) -> float:
        """Time since then."""
        return round(time.monotonic() - self._start_s, 3)


@contextmanager
def _unit_work(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, worker: Worker, stage: Stage
) -> Iterator[tuple[Callable[[Unit], Outcome], Progress]]:
    """Return the function that works off one unit, here or wherever the executor sends it, and who is told of each."""
    if options.executor.parallel == 1:
        yield partial(_attempt, worker), silent  # the stages of a unit show themselves
        return
    # Elsewhere the same folder may be another one: paths must not depend on where a process stands.
    place = _Place(
        matrix.model_dump_json(),
        options.device,
        logs.resolve(),
        out.resolve(),
        options.grids.resolve(),
        options.validation_logs and options.validation_logs.resolve(),
        options.trainings and options.trainings.resolve(),
        options.executor.threads,
    )
    with stage("rows") as progress:
        yield partial(_attempt_elsewhere, place), progress


class _Place(NamedTuple):
    """All that another process needs to work on a run; equal places share a worker."""

    matrix: str
    device: str
    logs: Path
    out: Path
    grids: Path
    validation_logs: Path | None
    trainings: Path | None
    threads: int | None


def _attempt_elsewhere(place: _Place, unit: Unit) -> Outcome:
    return _attempt(_worker_at(place), unit)


@lru_cache(maxsize=1)
def _worker_at(place: _Place) -> Worker:
    """Make the worker of a process that gets units of one run; it keeps the grids between them."""
    if place.threads is not None:
        torch.set_num_threads(place.threads)  # torch may have been imported before its environment was set
    options = RunOptions(
        place.device, place.grids, command="", validation_logs=place.validation_logs, trainings=place.trainings
    )
    return make_worker(Matrix.model_validate_json(place.matrix), place.logs, place.out, options, silent_stage)


def wanted_rows(matrix: Matrix, only: Sequence[str]) -> list[Row]:
    """Return the rows that are asked for by names or patterns like `BL-*`, all of them where nothing is asked for.

    Raises:
        ConfigError: a name or pattern fits no row.
    """
    found = {pattern: [row for row in matrix.rows if _is_asked(row, pattern)] for pattern in only}
    for pattern, rows in found.items():
        if not rows:
            names = ", ".join(sorted(row.name for row in matrix.rows))
            raise ConfigError(f"{pattern!r} is not a row of this matrix: {names}", field="row")
    return [row for row in matrix.rows if not only or any(row in rows for rows in found.values())]


def _is_asked(row: Row, pattern: str) -> bool:
    """Tell whether a name or pattern means a row; a name may itself hold signs of patterns."""
    return row.name == pattern or fnmatchcase(row.name, pattern)


def wanted_keys(matrix: Matrix, only: Sequence[str]) -> set[str]:
    """Return the keys of the units of the rows that are asked for."""
    return {key for row in wanted_rows(matrix, only) for key, _ in units_of(row, matrix.seed)}


def _finished(worker: Worker, unit: Unit) -> Outcome | None:
    """Find what an earlier run left of a unit."""
    try:
        job = worker.look(unit.row, unit.seed)
    except (SemgridError, torch.OutOfMemoryError):
        return None
    return Outcome(job.result_id, None, job.left_out) if worker.is_done(job) else None


def _attempt(worker: Worker, unit: Unit) -> Outcome:
    try:
        job = worker.run(unit.row, unit.seed)
    except SemgridError as error:
        return Outcome(None, str(error), {})
    except (RuntimeError, MemoryError) as error:  # what torch and its libraries raise
        # On a CPU, torch has no type for it.
        if isinstance(error, (torch.OutOfMemoryError, MemoryError)) or "allocate memory" in str(error):
            raise NoRoomError(f"out of memory: {first_line(error)}") from error
        return Outcome(None, f"{type(error).__name__}: {first_line(error)}", {})
    return Outcome(job.result_id, None, job.left_out)


def units_of(row: Row, first_seed: int) -> Iterator[tuple[str, Unit]]:
    """Return the units of a row with the keys by which rows that mean the same share them."""
    seeds = range(first_seed, first_seed + row.repeats) if row.trained else [None]
    for seed in seeds:
        yield digest_value([identity(row), seed]), Unit(row, seed)


def _record(
    matrix: Matrix, command: str, started: _Clock, worker: Worker, outcomes: dict[str, Outcome]
) -> results.RunRecord:
    logs = [log for sources in worker.sources for log in sources.records.values()]
    failed: dict[str, str] = {}
    for sources in worker.sources:  # a log to train on and one to score may have the same path in their folders
        for log, reason in sources.failed.items():
            failed[log] = f"{failed[log]}; {reason}" if log in failed else reason
    return results.RunRecord(
        format_version=results.FORMAT_VERSION,
        title=matrix.title,
        command=command,
        matrix=matrix.model_dump(mode="json"),
        versions=versions(),
        machine=machine(worker.device, worker.threads),
        started=started.utc,
        seconds=started.seconds(),
        logs=tuple(sorted(logs, key=lambda log: log.path)),  # under one path, the log to score comes last
        failed_logs=failed | _too_short(outcomes),
        rows=tuple(_row_record(row, matrix.seed, outcomes) for row in matrix.rows),
    )


def _too_short(outcomes: dict[str, Outcome]) -> dict[str, str]:
    """Name the logs that gave some row no window."""
    found: dict[str, str] = {}
    for outcome in outcomes.values():
        for log, reason in outcome.left_out.items():
            found.setdefault(log, f"{log}: {reason}")
    return found


def _row_record(row: Row, first_seed: int, outcomes: dict[str, Outcome]) -> results.RowRecord:
    done = [outcomes[key] for key, _ in units_of(row, first_seed) if key in outcomes]
    failures = [outcome.failure for outcome in done if outcome.failure is not None]
    found = [outcome.result_id for outcome in done if outcome.result_id is not None]
    return results.RowRecord(
        facts=row.facts,
        name=row.name,
        label=row.label,
        results=tuple(found),
        failure=failures[0] if failures else (None if done else results.NOT_RUN),
    )
