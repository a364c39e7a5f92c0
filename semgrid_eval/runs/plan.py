"""What a run would do, and about how long it would take on this machine: measured on the run's own windows."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from semgrid_eval.errors import InputError, SemgridError, first_line
from semgrid_eval.files import digest_value
from semgrid_eval.models.checkpoint import HISTORY_FILE, read_history
from semgrid_eval.models.device import torch_threads
from semgrid_eval.models.training import train
from semgrid_eval.progress import Stage, silent_stage
from semgrid_eval.runs.matrix import Matrix, Row
from semgrid_eval.runs.runner import RunOptions, Unit, make_worker, plan_units, units_of, wanted_keys
from semgrid_eval.runs.unit import Training, Worker

CALIBRATION_EPOCHS = 3
CALIBRATION_UPDATES = 4
SCORING_SHARE = 0.4
"""Time of a forward pass against forward and backward together, as measured on CPUs; it prices validation."""


@dataclass(frozen=True)
class PlannedUnit:
    """A row with one seed.

    Args:
        rows: names of the rows that share it.
        updates: still to be made, 0 where nothing is left to train or a unit before it trains the same.
        samples: windows to be seen by them.
        seconds: estimated; 0 where the result or the training is there already.
        failure: why it cannot be run.
    """

    rows: tuple[str, ...]
    seed: int | None
    windows: int
    updates: int
    samples: int
    seconds: float
    done: bool
    failure: str | None = None


def plan_run(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, *, stage: Stage = silent_stage
) -> list[PlannedUnit]:
    """List what a run would do; grids are built, which the run then finds, and nothing is trained but samples.

    Raises:
        InputError: there is no log at all, or the device does not exist.
    """
    wanted = wanted_keys(matrix, options.only)
    worker = make_worker(matrix, logs, out, options, stage)
    for sources in worker.sources:
        sources.prepare()
    units = {key: unit for key, unit in plan_units(matrix).items() if key in wanted}
    sharing: dict[str, list[str]] = {key: [] for key in units}
    for row in matrix.rows:
        for key, _ in units_of(row, matrix.seed):
            if key in sharing:
                sharing[key].append(row.name)
    speed = _Speed(worker)
    priced: set[str] = set()
    planned = []
    with stage("plan") as progress:
        for number, (key, unit) in enumerate(units.items(), start=1):
            planned.append(_plan_unit(worker, unit, tuple(sharing[key]), speed, priced))
            progress(number, len(units), unit.row.name)
    return planned


def total_seconds(units: Sequence[PlannedUnit]) -> float:
    """Sum the estimates."""
    return sum(unit.seconds for unit in units)


def _plan_unit(worker: Worker, unit: Unit, rows: tuple[str, ...], speed: "_Speed", priced: set[str]) -> PlannedUnit:
    """Plan one unit; `priced` collects the trainings that are counted already, which the unit may share."""
    try:
        job = worker.look(unit.row, unit.seed)
        done = unit.row.built_in and worker.is_done(job)
        if done or job.training is None or job.training.id in priced:
            return PlannedUnit(rows, unit.seed, len(job.scored), 0, 0, 0.0, done)
        made = _epochs_made(job.training)
        updates = _updates_left(unit.row, made)
        seconds = speed.seconds(unit.row, job.training, made) if updates else 0.0
    except (SemgridError, RuntimeError, MemoryError) as error:  # torch runs out of memory by a RuntimeError
        return PlannedUnit(rows, unit.seed, 0, 0, 0, 0.0, done=False, failure=first_line(error))
    priced.add(job.training.id)
    return PlannedUnit(rows, unit.seed, len(job.scored), updates, updates * unit.row.training.batch, seconds, done)


def _epochs_made(training: Training) -> int:
    """Count the epochs that an earlier run has left; a damaged training is the run's to report."""
    try:
        return len(read_history(training.folder / HISTORY_FILE))
    except InputError:
        return 0


def _updates_left(row: Row, epochs_made: int) -> int:
    return row.training.updates_until(row.training.epochs) - row.training.updates_until(epochs_made)


class _Speed:
    """Seconds that trainings take, measured once for each shape of network, batch and input."""

    def __init__(self, worker: Worker) -> None:
        self._worker = worker
        self._seconds_by_shape: dict[str, float] = {}

    def seconds(self, row: Row, training: Training, epochs_made: int) -> float:
        """Estimate the rest of a training with its validation after each epoch."""
        shape = digest_value(
            [
                row.network.model_dump(),
                row.training.batch,
                row.training.precision,
                training.windows.grids_per_window,
                list(training.windows.data.grids.shape[-2:]),
            ]
        )
        if shape not in self._seconds_by_shape:
            self._seconds_by_shape[shape] = self._measure(row, training)
        of_update = self._seconds_by_shape[shape]
        validated = (row.training.epochs - epochs_made) * len(training.watched or ())
        return of_update * (_updates_left(row, epochs_made) + SCORING_SHARE * validated / row.training.batch)

    def _measure(self, row: Row, training: Training) -> float:
        short = row.training.model_copy(
            update={"epochs": CALIBRATION_EPOCHS, "updates_per_epoch": CALIBRATION_UPDATES, "epoch_unit": "batches"}
        )
        with tempfile.TemporaryDirectory() as folder, torch_threads(self._worker.threads):
            path = Path(folder) / "sample"
            trained = train(training.windows, row.network, short, seed=0, device=self._worker.device, folder=path)
        return min(epoch.seconds for epoch in trained.history) / CALIBRATION_UPDATES
