"""How long-running work reports its progress; the command line shows it, tests and other programs may ignore it."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol


class Progress(Protocol):
    """Called after each finished piece of work."""

    def __call__(self, done: int, total: int, message: str = "") -> None:
        """Say that `done` of `total` pieces are finished and, in a few words, which one it was."""


def silent(done: int, total: int, message: str = "") -> None:
    """Ignore progress."""


class Stage(Protocol):
    """Opens the progress of one named stage of work."""

    def __call__(self, label: str) -> AbstractContextManager[Progress]:
        """Begin a stage called `label`; it ends when the block does."""


@contextmanager
def silent_stage(label: str) -> Iterator[Progress]:
    """Open a stage of work whose progress nobody watches."""
    yield silent
