"""The `semgrid-eval` command and the one place where errors become exit codes."""

import importlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

import click

from semgrid_eval import __version__
from semgrid_eval.cli.groups import TableGroup, option_of
from semgrid_eval.errors import InputError, SemgridError, printable

COMMANDS = {
    "demo": "All of the below on a simulated town, in some minutes.",
    "convert": "Recordings to logs: Cityscapes, bags, KITTI, a town.",
    "check": "Is a log whole and plausible? Saves what is whole of it.",
    "segment": "Label images for logs, by a segmentation network.",
    "grids": "Logs to semantic grids, each made once.",
    "run": "Train and score the rows of a matrix.",
    "report": "A run's page, tables and figures.",
    "play": "What rows predicted, as a log for viewers.",
    "cache": "Which grids and towns are kept; removes unused ones.",
    "latency": "How long a perception chain takes on this machine.",
    "bench": "How fast everything is on this machine.",
}
"""Modules of `semgrid_eval.cli`, each with its line of `--help`."""
_GO_ON = ("convert", "segment", "grids", "run", "demo")
"""Commands that keep what is done, so that after a stop they need not begin again."""


def _load(name: str) -> click.Command:
    command = importlib.import_module(f"semgrid_eval.cli.{name}").command
    assert isinstance(command, click.Command)
    return command


class _Commands(TableGroup):
    """All commands; one that is stopped says whether it goes on from there, and of an option how it is typed."""

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 - whatever a command returns
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            what_next = "; the same command continues from here" if ctx.invoked_subcommand in _GO_ON else ""
            raise click.Abort(what_next) from error
        except InputError as error:
            if option := option_of(error, ctx):
                raise InputError(str(error).removeprefix(f"{error.field}: "), field=option) from error
            raise


@click.group(
    cls=_Commands,
    table=lambda: COMMANDS,
    load=_load,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="semgrid-eval")
def cli() -> None:
    """Evaluate short-term prediction on semantic grids, from recorded MCAP logs."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; a user's mistake, or the system's refusal, ends it with one line and exit code 1 or 2."""
    _open_streams()
    try:
        with _terminable(), _warned():
            result: Any = cli.main(args=arguments, prog_name="semgrid-eval", standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:
        with suppress(OSError):
            error.show()
        _leave("", error.exit_code)
    except SemgridError as error:
        _leave(f"Error: {printable(str(error))}", 1)
    except (KeyboardInterrupt, click.Abort) as stop:
        _leave(f"\nStopped{stop}.", 130)  # the terminal shows ^C in the line before
    except OSError as error:
        place = "the output" if error.filename is None else printable(os.fsdecode(error.filename))
        _leave("" if isinstance(error, BrokenPipeError) else f"Error: {place}: {error.strerror or error}", 1)
    sys.exit(result if isinstance(result, int) else 0)


def _leave(text: str, code: int) -> NoReturn:
    """Say one line, if anybody listens, and end; what could not be printed is not tried again."""
    if text:
        with suppress(OSError):
            click.echo(text, err=True)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    sys.exit(code)


def _open_streams() -> None:
    """Let the three standard streams lead somewhere: no file of ours may take the number of one that was closed."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


class _Warnings(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        click.echo(f"Warning: {printable(record.getMessage())}", err=True)


@contextmanager
def _warned() -> Iterator[None]:
    """Say inside the block what the package warns of."""
    warnings, package = _Warnings(logging.WARNING), logging.getLogger("semgrid_eval")
    package.addHandler(warnings)
    try:
        yield
    finally:
        package.removeHandler(warnings)


@contextmanager
def _terminable() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, so that temporary files are removed; a handler set before stays."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


if __name__ == "__main__":
    main()
