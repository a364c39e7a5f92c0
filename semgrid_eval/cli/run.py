"""`semgrid-eval run`: run an experiment matrix."""

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from semgrid_eval.cli.console import command_line, complain, loudness_options, progress, say
from semgrid_eval.cli.options import (
    FOLDER,
    FOLDER_THERE,
    THERE,
    Folders,
    chosen_executor,
    device_option,
    executor_options,
    own_model_options,
    workers_option,
)
from semgrid_eval.cli.types import Number, Whole
from semgrid_eval.errors import printable
from semgrid_eval.presets import preset_names
from semgrid_eval.words import plural
from semgrid_eval.workplace import LOCAL

if TYPE_CHECKING:  # torch takes seconds to import, and --help should not
    from semgrid_eval.runs.matrix import Matrix
    from semgrid_eval.runs.runner import RunOptions
    from semgrid_eval.scores.results import RunRecord

_TRAININGS = "Trained networks (default: OUT/trainings); those of another run are used where they fit."
_ANY_MACHINE = "Take trainings of other machines, too: of a GPU, in another precision, with other threads."
_MODEL = "One more row: a model of your own, path.py:Class, or an installed one."


def _completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Complete the name of a preset, or else of a file."""
    names = [name for name in preset_names() if name.startswith(incomplete)]
    return [CompletionItem(name) for name in names] or [CompletionItem(incomplete, type="file")]


@click.command("run", epilog="Example: semgrid-eval run baselines --logs logs --out runs/first")
@click.argument("matrix", shell_complete=_completed)
@click.option("--logs", required=True, type=THERE, help="Folder of MCAP logs.")
@click.option("--out", required=True, type=FOLDER, help="Folder of the run.")
@click.option("--grids", type=FOLDER, help="Grid cache (default: OUT/grids).")
@click.option("--validation-logs", type=THERE, help="Folder of the logs to score, where they are not in --logs.")
@click.option("--trainings", type=FOLDER_THERE, help=_TRAININGS)
@click.option("--any-machine", is_flag=True, help=_ANY_MACHINE)
@click.option("--model", "models", multiple=True, help=_MODEL)
@click.option("--row", "only", multiple=True, help="Only this row, or rows like 'BL-*'; may be repeated.")
@device_option
@click.option("--jobs", type=Whole(1, 256), default=1, show_default=True, help="Rows trained at once.")
@workers_option("Logs made into grids at once.")
@executor_options
@own_model_options
@click.option("--gpus", type=Number(0), default=0.0, help="With Ray: GPUs for each row; fractions share one.")
@click.option(
    "--pictures/--no-pictures", default=True, show_default=True, help="Keep small pictures for the report's examples."
)
@click.option("--dry-run", is_flag=True, help="Only say what would be done and how long it would take.")
@loudness_options
def command(
    matrix: str,
    logs: Path,
    out: Path,
    grids: Path | None,
    validation_logs: Path | None,
    trainings: Path | None,
    models: tuple[str, ...],
    only: tuple[str, ...],
    device: str,
    jobs: int,
    workers: int,
    executor: str,
    address: str,
    own_models: str,
    time_limit: float,
    memory_limit: float | None,
    gpus: float,
    *,
    any_machine: bool,
    pictures: bool,
    dry_run: bool,
) -> int:
    """Train and score every row of MATRIX, a YAML file or the name of a preset.

    Finished work is kept; run the same command again to continue. A row that fails is noted
    with its reason, the others go on, and the exit code is 1. A row that asks for a truth that the logs do not hold is
    skipped, with its reason, and is no failure.

    Rows can be spread over processes of this machine (--jobs) or over a Ray cluster (--executor ray), whose machines
    must all reach the folders of logs, grids and the run under the same paths.

    --model adds a row named after the class, with the defaults of MATRIX. Models of your own run in processes apart, so
    that one that hangs, crashes or ends its process is a row that fails; their code has all your rights there, too.

    --dry-run builds the grids, which a run then finds, times a few updates of each network and what is asked of one
    log's truth, and prints the plan.
    """
    from semgrid_eval.executors import local_executor
    from semgrid_eval.models.device import visible_gpus
    from semgrid_eval.models.memory import guest_limits
    from semgrid_eval.models.registry import own_models as run_own_models
    from semgrid_eval.runs.matrix import load_matrix
    from semgrid_eval.runs.runner import RunOptions

    with run_own_models(guest_limits(time_limit, memory_limit) if own_models == "apart" else None):
        resolved = load_matrix(matrix, models=models)
        shared = visible_gpus() if device in ("auto", "cuda") else ()
        kept = grids or out / "grids"
        folders = Folders([*filter(None, (logs, validation_logs, trainings))], out)
        rows_on = chosen_executor(executor, address, jobs, folders, gpus=gpus, shared=shared)
        # A cluster that is started here has --jobs cores, and grids are to be built on --workers.
        built = folders._replace(written=kept)
        grids_on = local_executor(workers) if address == LOCAL else chosen_executor(executor, address, workers, built)
        options = RunOptions(
            device, kept, command_line(), only, rows_on, grids_on, pictures, validation_logs, trainings, any_machine
        )
        work = _show_plan if dry_run else _run
        code = work(resolved, logs, out, options)
    return code  # noqa: RET504 - mypy takes the block for one that may swallow errors


def _run(matrix: "Matrix", logs: Path, out: Path, options: "RunOptions") -> int:
    from semgrid_eval.runs.runner import run_matrix, wanted_rows

    record = run_matrix(matrix, logs, out, options, stage=progress)
    code = show_run(record, {row.name for row in wanted_rows(matrix, options.only)})
    click.echo(out)
    return code


def show_run(record: "RunRecord", rows: Collection[str]) -> int:
    """Print which of the named rows and which logs failed, or cannot be, and return the exit code."""
    for row in (row for row in record.rows if row.skipped and row.name in rows):
        complain(f"Warning: row {row.name} is skipped: {row.skipped}")
    failed = [row for row in record.rows if row.failure and row.name in rows]
    for row in failed:
        complain(f"Error: row {row.name}: {row.failure}")
    for reason in record.failed_logs.values():
        complain(f"Error: {reason}")
    return 1 if record.failed_logs or failed else 0


def _show_plan(matrix: "Matrix", logs: Path, out: Path, options: "RunOptions") -> int:
    from semgrid_eval.runs.plan import plan_run

    units = plan_run(matrix, logs, out, options, stage=progress)
    click.echo("rows\tseed\twindows\tupdates\tsamples\tminutes\tstate")
    for unit in units:
        skipped = unit.skipped and f"skipped: {unit.skipped}"
        state = unit.failure or skipped or ("done" if unit.done else "to do")
        numbers = (unit.seed if unit.seed is not None else "-", unit.windows, unit.updates, unit.samples)
        cells = (",".join(unit.rows), *numbers, f"{unit.seconds / 60:.1f}", state)
        click.echo("\t".join(printable(str(cell)) for cell in cells))
    at_once = options.executor.parallel
    minutes = sum(unit.seconds for unit in units) / 60 / at_once
    say(f"About {plural(round(minutes), 'minute')} on this machine, {at_once} at a time.")
    return 1 if any(unit.failure for unit in units) else 0
