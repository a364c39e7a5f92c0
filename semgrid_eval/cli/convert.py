"""`semgrid-eval convert`: bring recordings into the form of logs, by a command for each source."""

from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from semgrid_eval.cli.console import progress, say
from semgrid_eval.cli.options import FOLDER, chosen_executor, executor_options, parameters_of, workers_option
from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError, MissingExtraError
from semgrid_eval.sources.known import SOURCES, Source, load_source

if TYPE_CHECKING:
    from semgrid_eval.log.convert import ConversionSummary


_INSPECT = "inspect"
_INSPECT_HELP = (
    "Say what is there, and write what a conversion needs to know; nothing is converted, and OUT is left out."
)


class _Sources(click.Group):
    """Imports a source only when its command is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(SOURCES)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in SOURCES:
            return None
        try:
            return command_of(cmd_name, load_source(cmd_name))
        except MissingExtraError as error:
            return _not_installed(cmd_name, error)


@click.group("convert", cls=_Sources)
def command() -> None:
    """Convert recordings to MCAP logs, one log a recording."""


def command_of(name: str, source: Source[Any]) -> click.Command:
    """Make the command of a source."""

    @workers_option("Logs at once.")
    @executor_options
    def convert(workers: int, executor: str, address: str, out: Path | None = None, **given: Any) -> int:  # noqa: ANN401
        from semgrid_eval.log.convert import Work

        if given.pop(_INSPECT, False):
            assert source.inspect is not None
            click.echo(source.inspect(parse_config(source.options, given)))
            return 0
        assert out is not None, "it may be left out with --inspect alone"
        work = Work(workers, chosen_executor(executor, address, workers), given.pop("cache", None), progress)
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


def show(summary: "ConversionSummary", out: Path) -> int:
    """Print what became of a conversion, and return the exit code."""
    for label, reason in summary.failed.items():
        say(f"Error: {label}: {reason}")
    say(f"{out}: {len(summary.written)} written, {len(summary.skipped)} up to date, {len(summary.failed)} failed")
    others = _strays(out, summary)
    if others:
        say(f"Warning: {out} holds {len(others)} logs that do not belong to this conversion, such as {others[0]}")
    if summary.remark:
        say(summary.remark)
    return 1 if summary.failed else 0


def _strays(out: Path, summary: "ConversionSummary") -> list[Path]:
    """Return the logs that a conversion neither wrote nor found there.

    Unless it is for all splits, those of other splits do not count: each may be converted by a command of its own.
    """
    from semgrid_eval.log.store import find_logs, label_of

    splits = {label.split("/")[0] for label in summary.labels}
    try:
        logs = find_logs(out)
    except InputError:  # every recording failed
        return []
    others = {label_of(log, out): log for log in logs if label_of(log, out) not in summary.labels}
    return [log for label, log in others.items() if summary.all_splits or label.split("/")[0] in splits]


def _not_installed(name: str, missing: MissingExtraError) -> click.Command:
    """Stand in for a command whose packages are missing, so that the help of the others still works."""

    def refuse() -> None:
        raise missing

    return click.Command(
        name,
        callback=refuse,
        short_help=f"({missing})",
        add_help_option=False,
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    )
