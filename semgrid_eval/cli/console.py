"""What the commands show: progress bars on a terminal, plain lines elsewhere, always on stderr."""

import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import click

from semgrid_eval.errors import printable
from semgrid_eval.progress import Progress

PLAIN_LINE_INTERVAL_S = 10.0


def say(text: str) -> None:
    """Print one line of status on stderr, whatever names are in it."""
    click.echo(printable(text), err=True)


def command_line() -> str:
    """Return the command line as a user would type it again."""
    return shlex.join(["semgrid-eval", *sys.argv[1:]])


@contextmanager
def progress(label: str) -> Iterator[Progress]:
    """Show one progress bar named `label` while the block runs (a plain line now and then off a terminal)."""
    if sys.stderr.isatty():
        yield from _bar(label)
    else:
        yield _PlainLines(label)


def _bar(label: str) -> Iterator[Progress]:
    from rich import progress as rich  # not needed for any --help
    from rich.console import Console

    columns = (
        *(rich.SpinnerColumn(), rich.TextColumn("{task.description}"), rich.BarColumn(), rich.MofNCompleteColumn()),
        *(rich.TimeElapsedColumn(), rich.TimeRemainingColumn()),
        rich.TextColumn("{task.fields[message]}", markup=False),
    )
    with rich.Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task(label, total=None, message="")

        def update(done: int, total: int, message: str = "") -> None:
            bars.update(task, completed=done, total=total, message=printable(message))

        yield update


class _PlainLines:
    """Progress as lines for logs: the first, the last, and one every ten seconds."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._last_s = -PLAIN_LINE_INTERVAL_S

    def __call__(self, done: int, total: int, message: str = "") -> None:
        now_s = time.monotonic()
        if done >= total or now_s - self._last_s >= PLAIN_LINE_INTERVAL_S:
            self._last_s = now_s
            say(f"{self._label}: {done}/{total} {message}".rstrip())
