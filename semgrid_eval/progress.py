"""How long work tells its caller how far it is; the command line shows it, tests and other programs may ignore it."""

from typing import Protocol


class Progress(Protocol):
    """Called after each finished piece of work."""

    def __call__(self, done: int, total: int, message: str = "") -> None:
        """Say that `done` of `total` pieces are finished and, in a few words, which one it was."""


def silent(done: int, total: int, message: str = "") -> None:
    """Ignore progress."""
