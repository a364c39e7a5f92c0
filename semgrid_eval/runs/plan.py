"""What a run would do, and about how long it would take on this machine: measured on the run's own windows."""

import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import torch

from semgrid_eval.errors import InputError, UnknownTruthError
from semgrid_eval.files import digest_value
from semgrid_eval.grids.truth import Question
from semgrid_eval.models.checkpoint import HISTORY_FILE, read_history
from semgrid_eval.models.fitting import Lesson
from semgrid_eval.models.network import NetworkSettings, ScheduleConfig, TrainingConfig
from semgrid_eval.models.stand_in import make_ready
from semgrid_eval.progress import Stage, silent_stage
from semgrid_eval.runs.job import Job, Training
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.row import Row, Unit, plan_units, units_of
from semgrid_eval.runs.runner import RunOptions, failure_of, make_worker, wanted_rows
from semgrid_eval.runs.worker import Worker

SAMPLE = {"epochs": 3, "updates_per_epoch": 4, "epoch_unit": "batches", "schedule": ScheduleConfig()}
"""What is measured of a training, however long it is and whatever its learning rate."""
SCORING_SHARE = 0.4
"""Time of a forward pass against forward and backward together, as measured on CPUs; it prices validation."""


@dataclass(frozen=True)
class PlannedUnit:
    """A row with one seed."""

    rows: tuple[str, ...]  # names of the rows that share it
    seed: int | None
    windows: int
    updates: int  # still to be made, 0 where nothing is left to train or a unit before it trains the same
    samples: int  # windows to be seen by them
    seconds: float  # estimated; 0 where the result, or training and truth, are there already
    done: bool
    failure: str | None = None  # why it cannot be run
    skipped: str | None = None  # which truth the logs do not hold


def plan_run(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, *, stage: Stage = silent_stage
) -> list[PlannedUnit]:
    """List what a run would do; grids are built, which the run then finds, and nothing is trained but samples.

    One log is asked of each truth, and its answer kept, too.

    Raises:
        InputError: there is no log at all, or the device does not exist.
    """
    units = plan_units(wanted_rows(matrix, options.only), matrix.seed)
    worker = make_worker(matrix, logs, out, options, stage)
    for data in worker.data:
        data.prepare()
    sharing = defaultdict[str, list[str]](list)
    for row in matrix.rows:
        for key, _ in units_of(row, matrix.seed):
            sharing[key].append(row.name)
    prices = _Prices(_Speed(worker), _TruthSpeed(worker, options), set())
    planned = []
    with stage("plan") as progress:
        for number, (key, unit) in enumerate(units.items(), start=1):
            planned.append(_plan_unit(worker, unit, tuple(sharing[key]), prices))
            progress(number, len(units), unit.row.name)
    return planned


class _Prices(NamedTuple):
    """How long things take, and the trainings that are counted already."""

    training: "_Speed"
    truth: "_TruthSpeed"
    counted: set[str]


def _plan_unit(worker: Worker, unit: Unit, rows: tuple[str, ...], prices: _Prices) -> PlannedUnit:
    """Plan one unit, without a training that another one shares."""
    try:
        job = worker.look(unit.row, unit.seed)
        done = job.resolved.is_known and worker.is_done(job)
        settings, told_s = job.resolved.settings, 0.0 if done else prices.truth.seconds(unit.row)
        if done or not isinstance(settings, NetworkSettings) or not job.training or job.training.id in prices.counted:
            return PlannedUnit(rows, unit.seed, len(job.scored), 0, 0, told_s, done)
        made = _epochs_made(job.training)
        updates = _updates_left(settings.training, made)
        seconds = told_s + (prices.training.seconds(job, settings, made) if updates else 0.0)
    except UnknownTruthError as error:
        return PlannedUnit(rows, unit.seed, 0, 0, 0, 0.0, done=False, skipped=str(error))
    except Exception as error:
        reason = failure_of(error, unit.row)
        if reason is None:
            raise
        return PlannedUnit(rows, unit.seed, 0, 0, 0, 0.0, done=False, failure=reason)
    prices.counted.add(job.training.id)
    return PlannedUnit(rows, unit.seed, len(job.scored), updates, updates * settings.training.batch, seconds, done)


def _epochs_made(training: Training) -> int:
    """Count the epochs that an earlier run has left; a damaged training is the run's to report."""
    try:
        return len(read_history(training.folder / HISTORY_FILE))
    except InputError:
        return 0


def _updates_left(config: TrainingConfig, epochs_made: int) -> int:
    return config.updates_until(config.epochs) - config.updates_until(epochs_made)


class _TruthSpeed:
    """Seconds that it takes to work out what rows ask of the truth, measured on one log for each truth."""

    def __init__(self, worker: Worker, options: RunOptions) -> None:
        self._worker = worker
        # It is worked out before the rows, by as many processes as build grids.
        self._share = options.executor.parallel / options.grid_executor.parallel
        self._counted: set[Path] = set()

    def seconds(self, row: Row) -> float:
        """Estimate what is not worked out yet, nor counted for another row; the log that is measured is asked now.

        Raises:
            UnknownTruthError: it does not hold what the row's model asks for.
        """
        cache = self._worker.scored_data.cache
        if cache is None:
            return 0.0
        asked: dict[str, list[Question]] = {}
        for question in self._worker.questions(row):
            if (path := question.file(cache)) not in self._counted and not path.is_file():
                asked.setdefault(repr(question.truth), []).append(question)
        found_s = 0.0
        for questions in asked.values():
            try:
                found_s += self._measured(questions[0], cache) * len(questions)
            except UnknownTruthError:
                if questions[0].truth == row.asked:
                    raise
                continue  # a second target is left out
            self._counted.update(question.file(cache) for question in questions)
        return found_s

    def _measured(self, question: Question, cache: Path) -> float:
        start_s = time.perf_counter()
        question.answer(cache)
        return self._share * (time.perf_counter() - start_s)


class _Speed:
    """Seconds that trainings take, measured once for each build of network, batch and input."""

    def __init__(self, worker: Worker) -> None:
        self._worker = worker
        self._seconds: dict[str, float] = {}

    def seconds(self, job: Job, settings: NetworkSettings, epochs_made: int) -> float:
        """Estimate the rest of a training with its validation after each epoch."""
        sample = settings.model_copy(update={"training": settings.training.model_copy(update=SAMPLE)})
        resolved = job.resolved
        build = digest_value(
            [job.row.model, resolved.version, sample.model_dump(mode="json"), job.row.given.described()]
        )
        if build not in self._seconds:
            self._seconds[build] = self._measure(job, sample)
        config, watched = settings.training, job.training and job.training.watched
        validated = (config.epochs - epochs_made) * len(watched or ())
        return self._seconds[build] * (_updates_left(config, epochs_made) + SCORING_SHARE * validated / config.batch)

    def _measure(self, job: Job, sample: NetworkSettings) -> float:
        assert job.training is not None
        threads = torch.get_num_threads()
        torch.set_num_threads(self._worker.threads)
        try:
            with tempfile.TemporaryDirectory() as folder:
                windows, device = job.training.windows, self._worker.device
                lesson = Lesson(job.row.given, 0, device, windows, folder=Path(folder))
                fitted = make_ready(job.resolved.model, sample, lesson)
        finally:
            torch.set_num_threads(threads)
        assert fitted.epochs_s is not None, "a network was trained"
        return min(fitted.epochs_s) / sample.training.updates_per_epoch
