"""`semgrid-eval run`: work off an experiment matrix."""

from pathlib import Path

import click

from semgrid_eval.cli.console import command_line, progress, say
from semgrid_eval.executors import available_cores, local_executor


@click.command("run", epilog="Example: semgrid-eval run baselines --logs logs --out runs/first")
@click.argument("matrix")
@click.option("--logs", required=True, type=click.Path(path_type=Path, exists=True), help="Folder of MCAP logs.")
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the run.")
@click.option("--grids", type=click.Path(path_type=Path, file_okay=False), help="Grid cache (default: OUT/grids).")
@click.option("--device", default="auto", show_default=True, help="auto, cpu, cuda or cuda:N.")
@click.option("--jobs", type=click.IntRange(1, 256), default=1, show_default=True, help="Rows trained at once.")
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    default=available_cores(),
    show_default="all cores",
    help="Logs made into grids at once.",
)
def command(matrix: str, logs: Path, out: Path, grids: Path | None, device: str, jobs: int, workers: int) -> int:
    """Train and score every row of MATRIX, a YAML file or the name of a preset.

    Whatever is finished already is kept: the same command goes on where it was stopped. A row that fails is noted
    with its reason, the others go on, and the exit code is 1.
    """
    from semgrid_eval.runs.matrix import load_matrix
    from semgrid_eval.runs.runner import RunOptions, run_matrix

    options = RunOptions(device, grids or out / "grids", command_line(), local_executor(jobs), local_executor(workers))
    record = run_matrix(load_matrix(matrix), logs, out, options, stage=progress)
    for row in record.rows:
        if row.failure:
            say(f"Error: row {row.name}: {row.failure}")
    for reason in record.failed_logs.values():
        say(f"Error: {reason}")
    click.echo(out)
    return 1 if record.failed_logs or any(row.failure for row in record.rows) else 0
