"""`semgrid-eval convert`: bring recordings into the form of logs, by a command for each source."""

from inspect import cleandoc
from pathlib import Path
from typing import Any

import click

from semgrid_eval.cli.console import loudness_options, progress
from semgrid_eval.cli.converted import show
from semgrid_eval.cli.groups import TableGroup
from semgrid_eval.cli.options import FOLDER, Folders, chosen_executor, executor_options, workers_option
from semgrid_eval.sources.known import SOURCES, Source, load_source


def _summaries() -> dict[str, str]:
    return {name: known.summary for name, known in SOURCES.items()}


_INSPECT = "inspect"
_INSPECT_HELP = (
    "Say what is there, and write what a conversion needs to know; nothing is converted, and OUT is left out."
)


@click.group("convert", cls=TableGroup, table=_summaries, load=lambda name: command_of(name, load_source(name)))
def command() -> None:
    """Convert recordings to MCAP logs, one log a recording."""


def command_of(name: str, source: Source[Any]) -> click.Command:
    """Make the command of a source."""
    from semgrid_eval.cli.fields import parameters_of

    @workers_option("Logs at once.")
    @executor_options
    @loudness_options
    def convert(workers: int, executor: str, address: str, out: Path | None = None, **given: Any) -> int:  # noqa: ANN401
        from semgrid_eval.config import parse_config
        from semgrid_eval.log.convert import Work

        if given.pop(_INSPECT, False):
            assert source.inspect is not None
            click.echo(source.inspect(parse_config(source.options, given)))
            return 0
        assert out is not None, "it may be left out with --inspect alone"
        work_on = chosen_executor(executor, address, workers, Folders([], out))
        work = Work(workers, work_on, given.pop("cache", None), progress)
        return show(source.convert(parse_config(source.options, given), out, work), out)

    parameters = [*parameters_of(source.options), click.Argument(["out"], type=FOLDER)]
    if source.cache:
        parameters.append(click.Option(["--cache"], type=FOLDER, help=source.cache))
    kind = click.Command
    if source.inspect:
        parameters.append(click.Option([f"--{_INSPECT}"], is_flag=True, help=_INSPECT_HELP))
        kind = _Inspectable
    epilog = f"Example: {source.example}"
    return click.command(name, kind, params=parameters, help=cleandoc(source.help), epilog=epilog)(convert)


class _Inspectable(click.Command):
    """Needs no OUT where it is asked to inspect."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta[_INSPECT] = f"--{_INSPECT}" in args
        return super().parse_args(ctx, args)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        found = super().get_params(ctx)
        return [each for each in found if each.name != "out"] if ctx.meta.get(_INSPECT) else found
