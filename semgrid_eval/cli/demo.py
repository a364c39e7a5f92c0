"""`semgrid-eval demo`: from a simulated town to a report, with nothing to prepare."""

import time
from pathlib import Path

import click

from semgrid_eval.cli.console import command_line, loudness_options, progress, say
from semgrid_eval.cli.converted import show
from semgrid_eval.cli.options import FOLDER, device_option, workers_option
from semgrid_eval.cli.types import Whole

PRESET = "demo"
TOWNS = 8
"""Six for training and two for validation: training sees every kind of town."""


@click.command("demo", epilog="Example: semgrid-eval demo --out demo")
@click.option("--out", default="demo", show_default=True, type=FOLDER)
@click.option("--recordings", type=Whole(4, 10_000), default=96, show_default=True, help="Drives to simulate.")
@click.option("--seed", type=Whole(0), default=1, show_default=True)
@device_option
@workers_option("Processes at once.")
@loudness_options
def command(out: Path, recordings: int, seed: int, device: str, workers: int) -> int:
    """Simulate a town, record drives through it as logs, train, score and report: ten minutes on two cores.

    Prints the path of the finished page. Finished work is kept; run the same command again to continue.
    """
    from semgrid_eval.cli.run import show_run
    from semgrid_eval.config import parse_config
    from semgrid_eval.executors import local_executor
    from semgrid_eval.log.convert import Work
    from semgrid_eval.models.device import choose_device, visible_gpus
    from semgrid_eval.report.page.write import write_report
    from semgrid_eval.runs.matrix import load_matrix
    from semgrid_eval.runs.runner import RunOptions, run_matrix
    from semgrid_eval.sources.town.config import SyntheticConfig
    from semgrid_eval.sources.town.convert import convert_town

    start_s = time.monotonic()
    choose_device(device)  # what cannot be used is said before the towns are built
    logs, run = out / "logs", out / "run"
    config = parse_config(SyntheticConfig, {"recordings": recordings, "seed": seed, "towns": TOWNS})
    code = show(convert_town(config, logs, Work(workers, stage=progress)), logs)
    shared = visible_gpus() if device in ("auto", "cuda") else ()
    rows_on, grids_on = local_executor(workers, gpus=shared), local_executor(workers)
    options = RunOptions(device, out / "grids", command_line(), executor=rows_on, grid_executor=grids_on)
    record = run_matrix(load_matrix(PRESET), logs, run, options, stage=progress)
    page = write_report(run)
    code |= show_run(record, {row.name for row in record.rows})
    say(f"Finished in {time.monotonic() - start_s:.0f} s. Open this page in a browser:")
    click.echo(page)
    return code
