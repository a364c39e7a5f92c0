"""A bad input, and what becomes of the command that reads it."""

import atexit
import os
import re
import shlex
import shutil
import tempfile
from collections.abc import Callable, Mapping
from contextlib import chdir
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple

from support.commands import run_command

from semgrid_eval.errors import SemgridError
from semgrid_eval.files import digest_files

_DIGEST = re.compile(r"\b(?=[0-9]*[a-f])[0-9a-f]{16}\b")  # of what versions of packages are part of, too
_FINDING = ": error: |: not recovered: "  # of `check`, on stdout
_PROGRESS = r"\w[\w ]*: \d+/\d+|\S+: \d+ written|[\d,]+ logs? (checked|saved)|[\d,]+ recordings? in|$"
_NOT_ERRORS = rf"Usage: |Try 'semgrid-eval|Warning: |{_PROGRESS}"


def nothing() -> None:
    """Spoil nothing: the command itself is at fault."""


@dataclass(frozen=True)
class Bad:
    """A command that is given something bad, in a folder with good files."""

    words: str  # for the page, different in each kind
    command: str
    files: Mapping[str, bytes] = field(default_factory=dict)  # bad ones, put over the good
    spoil: Callable[[], object] = nothing  # what else is done to the folder


@dataclass(frozen=True)
class Kind:
    """Bad inputs of one kind; `whole` writes what is good into the working folder."""

    title: str
    about: str  # what the page says of all of them
    whole: Callable[[], object]
    inputs: tuple[Bad, ...]
    shows_code: bool = False  # whether `words` are what a file holds or a command says


class Outcome(NamedTuple):
    """What a command left."""

    code: int
    errors: list[str]  # without `Error: `
    other: list[str]  # lines that a user sees and that are neither errors, nor usage, nor progress
    changed: list[str]  # files that were there before and are not the same now
    partial: list[str]  # files that are not finished


def outcome(kind: Kind, bad: Bad) -> Outcome:
    """Run a command beside whole files of its kind, spoiled."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder).resolve() / "here"
        shutil.copytree(whole_files(kind.whole), place, symlinks=True)
        with chdir(place):
            for name, content in bad.files.items():
                Path(name).parent.mkdir(parents=True, exist_ok=True)
                Path(name).write_bytes(content)
            bad.spoil()
            before = _digests()
            code, told = run(bad.command)
            told = [_DIGEST.sub("(digest)", line.replace(f"{place}/", "").replace(str(place), ".")) for line in told]
            after = _digests()
    changed = [name for name, digest in before.items() if after.get(name) != digest]
    partial = [name for name in after if name.endswith(".part")]
    errors = [line.removeprefix("Error: ") for line in told if line.startswith("Error: ")]
    other = [line for line in told if not re.match(f"Error: |{_NOT_ERRORS}", line)]
    return Outcome(code, errors, other, changed, partial)


def run(command: str) -> tuple[int, list[str]]:
    """Run a command of `semgrid-eval` in this process.

    Returns its exit code, and the lines on stderr after the first error that a check found.
    """
    code, out, err = run_command(shlex.split(command))
    findings = [f"Error: {line}" for line in out.splitlines() if re.search(_FINDING, line)]
    return code, [*findings[:1], *err.splitlines()]


@cache
def whole_files(write: Callable[[], object]) -> Path:
    """Return a folder with the good files that a kind begins with, written once and removed when Python ends."""
    folder = Path(tempfile.mkdtemp(prefix="semgrid-whole-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    with chdir(folder):
        write()
    return folder


def _digests() -> dict[str, str]:
    return {str(path): _digest(path) for path in sorted(Path().rglob("*"))}


def _digest(path: Path) -> str:
    try:
        return digest_files([path]) if path.is_file() else ""
    except SemgridError:  # nobody may read it
        return str(os.lstat(path).st_size)


def table(command: str, name: str, contents: Mapping[str, bytes]) -> tuple[Bad, ...]:
    """Make a bad input of each content of the file `name`, by what the page says of it."""
    return tuple(Bad(words, command, {name: content}) for words, content in contents.items())


def lines(text: str) -> list[str]:
    """Return the lines of a table."""
    return text.strip().splitlines()
