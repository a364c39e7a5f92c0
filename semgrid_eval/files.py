"""Atomic output and content digests: nothing half-written is ever seen under its final name."""

import hashlib
import io
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from semgrid_eval.errors import InputError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

DIGEST_CHARACTERS = 16
_BLOCK_BYTES = 1 << 20


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a temporary file beside `path` for writing and move it into place when the block ends without error.

    Raises:
        InputError: the file cannot be written; errors of the block that are not about this file stay what they are.
    """
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with _writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            output = _Output(partial, path)
        with io.BufferedWriter(output) as stream:
            yield stream
            stream.flush()
            with _writing(path):
                os.fsync(stream.fileno())
        with _writing(path):
            partial.replace(path)
    finally:
        with suppress(OSError):  # it is gone after success, and its folder may never have been one
            partial.unlink()


class _Output(io.FileIO):
    """The temporary file of an output; a write that fails names the output."""

    def __init__(self, partial: Path, path: Path) -> None:
        self._path = path
        super().__init__(partial, "wb")

    def write(self, data: "ReadableBuffer", /) -> int:
        with _writing(self._path):
            return super().write(data)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot be written: {_reason(error)}", path=path) from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let one process at a time into the block for a folder, which is made if need be; a lock ends with its process.

    Where the system or the folder's file system has no locks, nobody waits.

    Raises:
        InputError: the folder cannot be written to.
    """
    with _writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        stream = (folder / ".lock").open("ab")
    with stream:
        if fcntl is not None:
            with suppress(OSError):
                fcntl.flock(stream, fcntl.LOCK_EX)
        yield


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Return a temporary folder beside `path` that becomes `path` (replacing it) when the block ends without error.

    Raises:
        InputError: the folder cannot be written to; errors of the block that name a file elsewhere stay what they are.
    """
    with _writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent))
    try:
        partial.chmod(0o755)
        yield partial
        with _writing(path):
            if path.exists():
                shutil.rmtree(path)
            partial.replace(path)
    except OSError as error:
        if error.filename is None or Path(os.fsdecode(error.filename)).is_relative_to(partial):
            raise InputError(f"cannot be written: {_reason(error)}", path=path) from error
        raise
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text atomically."""
    with atomic_file(path) as stream:
        stream.write(text.encode())


def write_json(path: Path, value: Any) -> None:  # noqa: ANN401 - anything that JSON can hold
    """Write JSON atomically, with sorted keys, so that equal values give equal bytes."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:  # noqa: ANN401 - anything that JSON can hold
    """Read a JSON file.

    Raises:
        InputError: the file is missing, unreadable or not JSON.
    """
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path=path) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not valid JSON: {error}", path=path) from error


def digest_value(value: Any) -> str:  # noqa: ANN401 - anything that JSON can hold
    """Digest a JSON value: equal values, equal digests, whatever the order of keys (16 hexadecimal characters)."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGEST_CHARACTERS]


def digest_files(paths: Iterable[Path]) -> str:
    """Digest the bytes of several files in the given order (16 hexadecimal characters).

    Raises:
        InputError: a file cannot be read.
    """
    total = hashlib.sha256()
    for path in paths:
        part = hashlib.sha256()
        try:
            with path.open("rb") as stream:
                while block := stream.read(_BLOCK_BYTES):
                    part.update(block)
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", path=path) from error
        total.update(part.digest())
    return total.hexdigest()[:DIGEST_CHARACTERS]


def _reason(error: OSError) -> str:
    # numpy has no error number for arrays that were written in part.
    return error.strerror or f"{error} (no space left?)"
