"""Runs a matrix: hands its units to an executor, and keeps the record of the run as it goes."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import torch

from semgrid_eval.errors import SemgridError
from semgrid_eval.executors import WorkerDied
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.progress import Stage, silent_stage
from semgrid_eval.runs.attempts import finished, make_worker, unit_work
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.options import RunOptions
from semgrid_eval.runs.record import Clock, Outcome, run_record
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.thumbnails import keep_pictures
from semgrid_eval.runs.units import plan_units, wanted_keys, wanted_rows
from semgrid_eval.runs.worker import Worker
from semgrid_eval.scores import results
from semgrid_eval.windows.data import WindowSet


def run_matrix(
    matrix: Matrix, logs: Path, out: Path, options: RunOptions, *, stage: Stage = silent_stage
) -> results.RunRecord:
    """Train and score every row; what is done already is kept, a row that fails is noted and the rest goes on.

    Raises:
        InputError: there is no log at all, or the device does not exist.
        ConfigError: `options.only` asks for a row that the matrix does not have.
    """
    started = Clock()
    units = plan_units(matrix)
    wanted = wanted_keys(matrix, options.only)
    worker = make_worker(matrix, logs, out, options, stage)
    for data in worker.data:
        data.prepare()
        data.identify()
    outcomes: dict[str, Outcome] = {}

    def look_for_others() -> None:
        for key, unit in units.items():
            if key not in outcomes and key not in wanted and (found := finished(worker, unit)):
                outcomes[key] = found

    def keep_record() -> results.RunRecord:
        record = run_record(matrix, options.command, started, worker, outcomes)
        results.write_run(out, record)  # a run that is stopped can be reported as far as it came
        return record

    look_for_others()
    keep_record()
    if options.pictures:
        rows = wanted_rows(matrix, options.only)
        keep_pictures(out, _scored_windows(worker, rows), options.grid_executor, stage)
    keys = [key for key in units if key in wanted]
    with unit_work(matrix, logs, out, options, worker) as (work, progress):
        progress(0, len(keys))
        for done, (index, outcome) in enumerate(options.executor.run(work, [units[key] for key in keys]), start=1):
            outcomes[keys[index]] = Outcome(None, outcome.reason, {}) if isinstance(outcome, WorkerDied) else outcome
            keep_record()
            progress(done, len(keys))
    look_for_others()  # another run may have worked on the same folder
    return keep_record()


def _scored_windows(worker: Worker, rows: Iterable[Row]) -> Iterator[tuple[WindowSet, GridConfig]]:
    """Return the windows of rows that have some, and how their grids were made."""
    for row in rows:
        with suppress(SemgridError, torch.OutOfMemoryError):  # its units will tell
            yield worker.scored_windows(row)[0], row.grid
