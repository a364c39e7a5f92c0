"""Atomic output, reading within bounds, and digests: nothing half-written is ever seen under its final name."""

import hashlib
import io
import json
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, BinaryIO

from semgrid_eval.errors import InputError
from semgrid_eval.faults import unreadable
from semgrid_eval.places import held_folder, hold, partial_of, put, restore

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

DIGEST_CHARACTERS = 16
READ_LIMIT_BYTES, JSON_LIMIT_BYTES = 64 << 30, 256 << 20
_BLOCK_BYTES = 1 << 20
_MAX_NAME_BYTES = 200
_SHOWN = 40  # characters


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a temporary file beside `path` for writing and move it into place when the block ends without error.

    Raises:
        InputError: the file cannot be written; errors of the block that are not about this file stay what they are.
    """
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial, output = _open_partial(path)
    try:
        with io.BufferedWriter(output) as stream:
            yield stream
            stream.flush()
            with writing(path):
                os.fsync(stream.fileno())
            with writing(path):
                partial.replace(path)
    finally:
        with suppress(OSError):  # it is gone after success, and its folder may have been removed
            partial.unlink()


class _Output(io.FileIO):
    """The temporary file of an output; a write that fails names the output."""

    def __init__(self, partial: Path, path: Path) -> None:
        self._path = path
        super().__init__(partial, "xb")

    def write(self, data: "ReadableBuffer", /) -> int:
        with writing(self._path):
            return super().write(data)


def _open_partial(path: Path) -> tuple[Path, _Output]:
    while True:
        partial = partial_of(path)
        output = _Output(partial, path)
        if hold(output.fileno()):
            return partial, output
        output.close()


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an error of the system into one line that names what was to be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be written: {_reason(error)}", path=path) from error


@contextmanager
def locked(folder: Path, name: str = ".lock") -> Iterator[None]:
    """Let one process at a time into the block for a folder, which is made if need be; a lock ends with its process.

    The file `name` there is what processes wait for; nothing of it is left. Where the system or the folder's file
    system has no locks, nobody waits.

    Raises:
        InputError: the folder cannot be written to.
    """
    stream = None
    while stream is None:
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            stream = (folder / name).open("ab")
        if not hold(stream.fileno()):  # whoever held it has removed it
            stream.close()
            stream = None
    with stream:
        try:
            yield
        finally:
            with suppress(OSError):
                (folder / name).unlink()


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Return a temporary folder beside `path` that becomes `path` (replacing it) when the block ends without error.

    Raises:
        InputError: the folder cannot be written to; errors of the block that name a file elsewhere stay what they are.
    """
    with writing(path):
        path = path.resolve() if path.is_symlink() else path
        path.parent.mkdir(parents=True, exist_ok=True)
        restore(path)
    with _filling(path), held_folder(path) as partial:
        yield partial
        with writing(path):
            put(partial, path)


@contextmanager
def _filling(path: Path) -> Iterator[None]:
    """Name a folder where a file below its temporary twin cannot be written."""
    try:
        yield
    except OSError as error:
        beside = path.with_name(f".{path.name}.")
        if error.filename is None or os.fsdecode(error.filename).startswith(str(beside)):
            raise InputError(f"cannot be written: {_reason(error)}", path=path) from error
        raise


def unnamed_file(folder: Path, size_bytes: int) -> BinaryIO:
    """Open a file of so many bytes that has no name in a folder: it is gone when it is closed, or its process ends.

    Raises:
        InputError: the folder cannot be written to, or has not so much room.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - whoever asked for it closes it
    try:
        # Where a system cannot take all of the room at once, writing says that it is not there.
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size_bytes)
        file.truncate(size_bytes)
    except OSError as error:
        file.close()
        needed = f"{size_bytes / (1 << 30):.1f} GiB are needed there for a while"
        raise InputError(f"cannot be written: {_reason(error)}; {needed}", path=folder) from error
    return file


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text atomically."""
    with atomic_file(path) as stream:
        stream.write(text.encode())


def write_json(path: Path, value: Any) -> None:  # noqa: ANN401 - anything that JSON can hold
    """Write JSON atomically, with sorted keys, so that equal values give equal bytes."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: Path, *, limit: int = JSON_LIMIT_BYTES) -> Any:  # noqa: ANN401 - anything that JSON can hold
    """Read a JSON file.

    Raises:
        InputError: the file is missing, unreadable, not JSON, or has more bytes than `limit`.
    """
    content = read_bytes(path, limit=limit)
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not valid JSON: {unreadable(error)}", path=path) from error


def open_regular(path: Path, *, limit: int = READ_LIMIT_BYTES) -> BinaryIO:
    """Open a regular file to be read; a pipe or a device, which may never end, is refused before it is waited for.

    Raises:
        InputError: it cannot be read, is something else than a file, or has more bytes than `limit`.
    """
    with reading(path):
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    found = os.fstat(descriptor)
    if stat.S_ISREG(found.st_mode) and found.st_size <= limit:
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    large = f"has {found.st_size} bytes, and {limit} are allowed"
    raise InputError(large if stat.S_ISREG(found.st_mode) else "is not a regular file", path=path)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn an error of the system into one line that names the file."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path=path) from error
    except (ValueError, MemoryError) as error:  # of a name that no file can have, or a file that does not fit
        raise InputError(f"cannot be read: {error or 'it does not fit into memory'}", path=path) from error


def read_bytes(path: Path, *, limit: int = READ_LIMIT_BYTES) -> bytes:
    """Read a whole regular file; an InputError is raised as `open_regular` does."""
    with open_regular(path, limit=limit) as stream, reading(path):
        return stream.read()


def require_file_name(text: str, what: str) -> None:
    """Make sure that a name can be that of a file, with an ending and whatever is put before it.

    Raises:
        ValueError: it cannot.
    """
    can_be = text not in ("", "..") and PurePath(text).name == text and "\0" not in text
    if not can_be or len(text.encode(errors="replace")) > _MAX_NAME_BYTES:
        shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
        raise ValueError(f"its {what} {shown!r} is not a file name of at most {_MAX_NAME_BYTES} bytes")


def digest_value(value: Any) -> str:  # noqa: ANN401 - anything that JSON can hold
    """Digest a JSON value: equal values, equal digests, whatever the order of keys (16 hexadecimal characters)."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGEST_CHARACTERS]


def digest_files(paths: Iterable[Path], *, limit: int = READ_LIMIT_BYTES) -> str:
    """Digest the bytes of several files in the given order (16 hexadecimal characters).

    Raises:
        InputError: a file cannot be read, is not a regular file, or has more bytes than `limit`.
    """
    total = hashlib.sha256()
    for path in paths:
        part = hashlib.sha256()
        with open_regular(path, limit=limit) as stream, reading(path):
            while block := stream.read(_BLOCK_BYTES):
                part.update(block)
        total.update(part.digest())
    return total.hexdigest()[:DIGEST_CHARACTERS]


def _reason(error: OSError) -> str:
    if isinstance(error, FileExistsError) and error.filename is not None:
        return f"{os.fsdecode(error.filename)} is there and is not a folder"
    # numpy has no error number for arrays that were written in part.
    return error.strerror or f"{error} (no space left?)"
