"""The family of errors that a user can cause; each message is one line that names file, field and value."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def printable(text: str) -> str:
    """Write characters that end a line, move a cursor or change the order of others as escapes, as Python does."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


class SemgridError(Exception):
    """Base of every error that is reported to the user as one line, without a traceback."""


class InputError(SemgridError):
    """A file or value given by the user cannot be used; `path` is the file, `field` the field or option at fault."""

    def __init__(self, message: str, *, path: Path | str | None = None, field: str | None = None) -> None:
        self.path = None if path is None else Path(path)
        self.field = field
        where = [str(part) for part in (path, field) if part is not None]
        super().__init__(printable(": ".join([*where, " ".join(message.split())])))


class ConfigError(InputError):
    """A configuration file or option is malformed, unknown or impossible."""


class LogError(InputError):
    """An MCAP log is damaged, incomplete or lacks what is needed."""


class AbsentSensorError(LogError):
    """An MCAP log, however sound, does not have the sensor that is asked of it."""


class UnknownTruthError(LogError):
    """An MCAP log does not hold the truth that was asked for: recordings of real sensors never do."""


class ResultError(InputError):
    """A result folder does not parse or does not belong where it is."""


class DamageError(ResultError):
    """A file that was kept is not what was written."""


class MissingExtraError(SemgridError):
    """An optional dependency is not installed; the message names the extra to install."""

    def __init__(self, extra: str, package: str) -> None:
        super().__init__(f"{package} is not installed; run: pip install 'semgrid-eval[{extra}]'")


@contextmanager
def located(
    *, path: Path | str | None = None, field: str | None = None, kind: type[InputError] = InputError
) -> Iterator[None]:
    """Let an InputError of the block, which it becomes one of a `kind` of, name the file and field that it is of."""
    try:
        yield
    except InputError as error:
        raise kind(str(error), path=path, field=field) from error


def first_line(error: BaseException) -> str:
    """Return the first line of what an error says."""
    return str(error).partition("\n")[0]
