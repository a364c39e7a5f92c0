"""`semgrid-eval convert`: bring recordings into the form of logs, by a command for each source."""

from inspect import cleandoc
from pathlib import Path
from typing import Any

import click

from semgrid_eval.cli.console import loudness_options, progress
from semgrid_eval.cli.converted import show
from semgrid_eval.cli.groups import TableGroup
from semgrid_eval.cli.options import FOLDER, chosen_executor, executor_options, workers_option
from semgrid_eval.sources.known import SOURCES, Source, load_source


def _summaries() -> dict[str, str]:
    return {name: known.summary for name, known in SOURCES.items()}


@click.group("convert", cls=TableGroup, table=_summaries, load=lambda name: command_of(name, load_source(name)))
def command() -> None:
    """Convert recordings to MCAP logs, one log a recording."""


def command_of(name: str, source: Source[Any]) -> click.Command:
    """Make the command of a source."""
    from semgrid_eval.cli.fields import parameters_of

    @workers_option("Logs at once.")
    @executor_options
    @loudness_options
    def convert(out: Path, workers: int, executor: str, address: str, **given: Any) -> int:  # noqa: ANN401 - options
        from semgrid_eval.config import parse_config
        from semgrid_eval.log.convert import Work

        work = Work(workers, chosen_executor(executor, address, workers), given.pop("cache", None), progress)
        return show(source.convert(parse_config(source.options, given), out, work), out)

    parameters = [*parameters_of(source.options), click.Argument(["out"], type=FOLDER)]
    if source.cache:
        parameters.append(click.Option(["--cache"], type=FOLDER, help=source.cache))
    made = click.command(name, params=parameters, help=cleandoc(source.help), epilog=f"Example: {source.example}")
    return made(convert)
