"""`semgrid-eval grids`: build, or re-use, the grids of a folder of logs."""

from pathlib import Path

import click

from semgrid_eval.cli.console import complain, loudness_options, progress, say
from semgrid_eval.cli.options import FOLDER, THERE, Folders, chosen_executor, executor_options, workers_option
from semgrid_eval.words import plural


def _print_classes(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        from semgrid_eval.class_files import default_classes_text

        click.echo(default_classes_text(), nl=False)
        ctx.exit()


@click.command("grids", epilog="Example: semgrid-eval grids logs grids")
@click.argument("logs", type=THERE)
@click.argument("out", type=FOLDER)
@click.option("--config", type=click.Path(path_type=Path, dir_okay=False), help="Grid configuration (YAML).")
@click.option(
    "--print-classes",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_classes,
    help="Print the file of the default classes, to begin own ones with, and end.",
)
@workers_option("Logs at once.")
@executor_options
@loudness_options
def command(logs: Path, out: Path, config: Path | None, workers: int, executor: str, address: str) -> int:
    """Build the semantic grids of all LOGS into the folder OUT.

    Each recording is built once for a configuration and found again by the digest of log and configuration.
    """
    from semgrid_eval.class_files import with_classes
    from semgrid_eval.config import load_yaml, parse_config
    from semgrid_eval.grids.build import build_grids
    from semgrid_eval.grids.spec import GridConfig
    from semgrid_eval.log.store import find_logs

    grid_config = GridConfig()
    if config:
        grid_config = parse_config(GridConfig, with_classes(load_yaml(config) or {}, config, "classes"), path=config)
    work_on = chosen_executor(executor, address, workers, Folders([logs], out))
    with progress("grids") as watch:
        data = build_grids(find_logs(logs), out, grid_config, executor=work_on, progress=watch)
    for reason in data.failed.values():
        complain(f"Error: {reason}")
    built = f"{plural(data.built, 'log')} built, {data.reused} re-used"
    say(f"{plural(len(data.recordings), 'recording')} in {out}: {built}")
    return 1 if data.failed else 0
