"""What the commands show: progress bars on a terminal, plain lines elsewhere, always on stderr.

`-q` leaves errors and warnings alone; `-v` gives every piece of work a line.
"""

import math
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

import click

from semgrid_eval.errors import printable
from semgrid_eval.progress import Progress, silent

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

PLAIN_LINE_INTERVAL_S = 10.0
Command = TypeVar("Command", bound=Callable[..., Any])
_LOUDNESS, _BARS = f"{__name__}.loudness", f"{__name__}.bars"


def loudness_options(command: Command) -> Command:
    """Add -q and -v to a command."""
    quiet = click.option("-q", "--quiet", help="Say nothing but errors and warnings.", **_NOTED)
    verbose = click.option("-v", "--verbose", help="Say a line for every piece of work.", **_NOTED)
    return quiet(verbose(command))


def _note(ctx: click.Context, option: click.Parameter, given: bool) -> None:
    if given and ctx.meta.setdefault(_LOUDNESS, option.name) != option.name:
        raise click.UsageError("--quiet and --verbose exclude each other")


_NOTED: dict[str, Any] = {"is_flag": True, "expose_value": False, "callback": _note}


def _loudness() -> str | None:
    ctx = click.get_current_context(silent=True)
    return None if ctx is None else ctx.meta.get(_LOUDNESS)


def say(text: str) -> None:
    """Print one line of status on stderr, whatever names are in it; nothing with -q."""
    if _loudness() != "quiet":
        complain(text)


def complain(text: str) -> None:
    """Print one line about what is wrong on stderr, whatever names are in it."""
    click.echo(printable(text), err=True)


def command_line() -> str:
    """Return the command line as a user would type it again."""
    return shlex.join(["semgrid-eval", *sys.argv[1:]])


@contextmanager
def progress(label: str) -> Iterator[Progress]:
    """Show one progress bar named `label` while the block runs (a plain line now and then off a terminal)."""
    loudness = _loudness()
    if loudness == "quiet":
        yield silent
    elif loudness == "verbose" or not sys.stderr.isatty():
        yield _PlainLines(label, 0.0 if loudness == "verbose" else PLAIN_LINE_INTERVAL_S)
    else:
        yield from _bar(label)


def _bar(label: str) -> Iterator[Progress]:
    with _bars() as bars:
        task = bars.add_task(label, total=None, message="")

        def update(done: int, total: int, message: str = "") -> None:
            bars.update(task, completed=done, total=total, message=printable(message))

        yield update


@contextmanager
def _bars() -> Iterator["Bars"]:
    """Show bars, below those that are shown already: what one piece of work waits for may have its own."""
    ctx = click.get_current_context(silent=True)
    meta = {} if ctx is None else ctx.meta
    if _BARS in meta:
        yield meta[_BARS]
        return
    with _new_bars() as bars:
        meta[_BARS] = bars
        try:
            yield bars
        finally:
            del meta[_BARS]


def _new_bars() -> "Bars":
    from rich import progress as rich  # not needed for any --help
    from rich.console import Console

    columns = (
        *(rich.SpinnerColumn(), rich.TextColumn("{task.description}"), rich.BarColumn(), rich.MofNCompleteColumn()),
        *(rich.TimeElapsedColumn(), rich.TimeRemainingColumn()),
        rich.TextColumn("{task.fields[message]}", markup=False),
    )
    return rich.Progress(*columns, console=Console(stderr=True))


class _PlainLines:
    """Progress as lines for logs: the first, the last, and one in every interval between them."""

    def __init__(self, label: str, interval_s: float) -> None:
        self._label, self._interval_s = label, interval_s
        self._last_s = -math.inf

    def __call__(self, done: int, total: int, message: str = "") -> None:
        now_s = time.monotonic()
        if done >= total or now_s - self._last_s >= self._interval_s:
            self._last_s = now_s
            complain(f"{self._label}: {done}/{total} {message}".rstrip())
