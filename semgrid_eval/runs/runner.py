"""Runs a matrix: tries its units here or wherever an executor sends them, and keeps the record as it goes."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache, partial
from pathlib import Path

import torch

from semgrid_eval.errors import ConfigError, SemgridError, UnknownTruthError, first_line
from semgrid_eval.executors import Executor, InProcess, NoRoomError, WorkerDied
from semgrid_eval.faults import not_one_of
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import Question
from semgrid_eval.models.device import choose_device, is_out_of_memory, memory_words, settle_process
from semgrid_eval.models.registry import MODELS, adopt, ways_of_own_models
from semgrid_eval.places import remove_stale
from semgrid_eval.progress import Progress, Stage, silent, silent_stage
from semgrid_eval.runs.data import GridSource, RunData
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.packed import PackedGrids, is_packed
from semgrid_eval.runs.record import Clock, Outcome, run_record
from semgrid_eval.runs.row import Row, Unit, plan_units, units_of
from semgrid_eval.runs.selection import first_of_each
from semgrid_eval.runs.thumbnails import keep_pictures
from semgrid_eval.runs.truth import work_out
from semgrid_eval.runs.worker import Worker, asks_of_truth
from semgrid_eval.scores import results
from semgrid_eval.windows.data import WindowSet
from semgrid_eval.windows.storage import Storage
from semgrid_eval.workplace import Limits


@dataclass(frozen=True)
class RunOptions:
    """How a matrix is run; but for the logs to score, nothing here changes its numbers on one machine."""

    device: str  # `auto`, `cpu`, `cuda`, `cuda:1`, ...
    grids: Path  # folder in which grids are kept
    command: str  # how the run was started, for the record
    only: tuple[str, ...] = ()  # names or patterns of rows, all where it is empty; what others have is kept on record
    executor: Executor = field(default_factory=InProcess)  # where rows are trained and scored
    grid_executor: Executor = field(default_factory=InProcess)  # where grids are built and pictures made small
    pictures: bool = True  # whether to keep small pictures of the windows' frames for the report
    validation_logs: Path | None = None  # folder of the logs to score, where they are not among those to train on
    # Folder of trainings, the run's own if not given; what another run has trained is found there.
    trainings: Path | None = None
    # Whether networks will do that were trained on another device, in another precision or with other threads.
    any_machine: bool = False


def run_matrix(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, *, stage: Stage = silent_stage
) -> results.RunRecord:
    """Train and score every row; what is done already is kept, a row that fails is noted and the rest goes on.

    `logs` is a folder of logs, or one of grids that `pack_grids` wrote.

    Raises:
        InputError: there is no log at all, or the device does not exist.
        ConfigError: `options.only` asks for a row that the matrix does not have.
    """
    started = Clock()
    rows = wanted_rows(matrix, options.only)
    units, wanted = plan_units(matrix.rows, matrix.seed), plan_units(rows, matrix.seed)
    worker = make_worker(matrix, logs, out, options, stage)
    _prepare(worker)
    outcomes: dict[str, Outcome] = {}

    def look_for_others() -> None:
        for key, unit in units.items():
            if key not in outcomes and key not in wanted and (found := _finished(worker, unit)):
                outcomes[key] = found

    def keep_record() -> results.RunRecord:
        record = run_record(matrix, options.command, started, worker, outcomes)
        results.write_run(out, record)  # a run that is stopped can be reported as far as it came
        return record

    look_for_others()
    keep_record()
    _look_into_logs(worker, rows, matrix.seed, options)
    keys = list(wanted)
    with _unit_work(matrix, logs, out, options, worker) as (work, progress):
        progress(0, len(keys))
        for done, (index, outcome) in enumerate(options.executor.run(work, list(wanted.values())), start=1):
            outcomes[keys[index]] = Outcome(None, outcome.reason, {}) if isinstance(outcome, WorkerDied) else outcome
            keep_record()
            progress(done, len(keys))
    look_for_others()  # another run may have worked on the same folder
    outcomes.update(_lost(out, outcomes))
    return keep_record()


def _prepare(worker: Worker) -> None:
    """Remove what runs that were killed have left half-written, and build all grids."""
    for folder in (worker.out, worker.trainings):
        remove_stale(folder)
    for data in worker.data:
        data.prepare()
        data.identify()


def _look_into_logs(worker: Worker, rows: Sequence[Row], first_seed: int, options: RunOptions) -> None:
    """Keep pictures and work out what is asked of the truth, where there are logs and not grids alone."""
    cache = worker.scored_data.cache
    if cache is None:
        return
    if options.pictures:
        keep_pictures(worker.out, _scored_windows(worker, rows), options.grid_executor, worker.stage)
    work_out(_questions(worker, rows, first_seed), cache, options.grid_executor, worker.stage)


def _lost(out: Path, outcomes: Mapping[str, Outcome]) -> dict[str, Outcome]:
    """Find the units whose results somebody has removed or damaged meanwhile."""
    there = {key: found.result_id for key, found in outcomes.items() if found.result_id is not None}
    lost = Outcome(None, "its result was removed or damaged while the run went on; run again to make it again", {})
    return {key: lost for key, found in there.items() if not results.is_done(results.result_folder(out, found))}


def wanted_rows(matrix: Matrix, only: Sequence[str]) -> list[Row]:
    """Return the rows that are asked for by names or patterns like `BL-*`, all of them where nothing is asked for.

    Raises:
        ConfigError: a name or pattern fits no row.
    """
    # A name may itself hold signs of patterns.
    found = {each: [row for row in matrix.rows if row.name == each or fnmatchcase(row.name, each)] for each in only}
    for pattern, rows in found.items():
        if not rows:
            raise ConfigError(not_one_of(pattern, sorted(row.name for row in matrix.rows)), field="row")
    return [row for row in matrix.rows if not only or any(row in rows for rows in found.values())]


def _scored_windows(worker: Worker, rows: Iterable[Row]) -> Iterator[tuple[WindowSet, GridConfig]]:
    """Return the windows of rows that have some, of streams one for each recording, and how their grids were made."""
    for row in rows:
        with suppress(SemgridError, torch.OutOfMemoryError):  # its units will tell
            windows = worker.scored_windows(row)[0]
            if len(windows):  # answers of a stream may all come too late
                yield (windows if row.stream is None else first_of_each(windows)), row.grid


def _questions(worker: Worker, rows: Iterable[Row], first_seed: int) -> Iterator[Question]:
    """Return what rows ask of the truth that have units to be worked on."""
    for row in filter(asks_of_truth, rows):
        with suppress(SemgridError, torch.OutOfMemoryError):  # its units will tell
            jobs = (worker.look(*unit) for _, unit in units_of(row, first_seed))
            if any(worker.is_due(job) for job in jobs):
                yield from worker.questions(row)


def make_worker(matrix: Matrix, logs: Path, out: Path, options: RunOptions, stage: Stage) -> Worker:
    """Make a worker of this process for the units of a matrix; it builds or reads grids when they are asked for."""
    settle_process()
    device = choose_device(options.device)
    # Where others do the work, the grids here need no room on the device.
    place = device if options.executor.parallel == 1 else torch.device("cpu")

    def made(folder: Path) -> GridSource:
        if is_packed(folder):
            return PackedGrids(folder, matrix.rows, Storage(place, options.grids, stage))
        executor = options.grid_executor
        return RunData(folder, options.grids, matrix.rows, executor=executor, device=place, stage=stage)

    data = made(logs)
    return Worker(
        out=out,
        trainings=options.trainings or out / "trainings",
        training_data=data,
        scored_data=made(options.validation_logs) if options.validation_logs else data,
        device=device,
        threads=options.executor.threads or torch.get_num_threads(),
        example_seed=matrix.seed,
        stage=stage,
        any_machine=options.any_machine,
    )


@contextmanager
def _unit_work(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, worker: Worker
) -> Iterator[tuple[Callable[[Unit], Outcome], Progress]]:
    """Return the function that tries one unit, here or wherever the executor sends it, and who is told of each."""
    if options.executor.parallel == 1:
        yield partial(_attempt, worker), silent  # the stages of a unit show themselves
        return
    # Elsewhere the same folder may be another one: paths must not depend on where a process stands.
    there = RunOptions(
        options.device,
        options.grids.resolve(),
        command="",
        validation_logs=options.validation_logs and options.validation_logs.resolve(),
        trainings=options.trainings and options.trainings.resolve(),
        any_machine=options.any_machine,
    )
    place = (matrix.model_dump_json(), logs.resolve(), out.resolve(), there, options.executor.threads)
    with worker.stage("rows") as progress:
        yield partial(_attempt_elsewhere, place, ways_of_own_models()), progress


def _finished(worker: Worker, unit: Unit) -> Outcome | None:
    """Find what an earlier run left of a unit."""
    try:
        job = worker.look(unit.row, unit.seed)
    except (SemgridError, torch.OutOfMemoryError):
        return None
    return Outcome(job.result_id, None, job.left_out) if worker.is_done(job) else None


def failure_of(error: Exception, row: Row) -> str | None:
    """Say in one line why a row failed; None where the fault is ours and is to be seen whole."""
    if isinstance(error, SemgridError):
        return str(error)
    if is_out_of_memory(error):
        return memory_words(error)
    # What torch and its libraries raise, or code of one's own that they call.
    if isinstance(error, RuntimeError) or row.model not in MODELS:
        return f"{type(error).__name__}: {first_line(error)}"
    return None


def _attempt_elsewhere(
    place: tuple[str, Path, Path, RunOptions, int | None], ways: tuple[Limits | None, str], unit: Unit
) -> Outcome:
    adopt(*ways)
    return _attempt(_worker_at(*place), unit)


@lru_cache(maxsize=1)
def _worker_at(matrix: str, logs: Path, out: Path, options: RunOptions, threads: int | None) -> Worker:
    """Make the worker of a process that gets units of one run; it keeps the grids between them."""
    if threads is not None:
        torch.set_num_threads(threads)  # torch may have been imported before its environment was set
    return make_worker(Matrix.model_validate_json(matrix), logs, out, options, silent_stage)


def _attempt(worker: Worker, unit: Unit) -> Outcome:
    try:
        job = worker.run(unit.row, unit.seed)
    except UnknownTruthError as error:
        return Outcome(None, None, {}, skipped=str(error))
    except Exception as error:
        reason = failure_of(error, unit.row)
        if reason is None:
            raise
        if is_out_of_memory(error):
            raise NoRoomError(reason) from error
        return Outcome(None, reason, {})
    return Outcome(job.result_id, None, job.left_out)
