"""Names in a folder: who writes where, what processes that were killed have left, and two names swapped in one step."""

import ctypes
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_PART = re.compile(r"\..+\.[0-9a-f]{8}\.part")
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def partial_of(path: Path) -> Path:
    """Return a new name beside a path for what is being written."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")


def hold(descriptor: int) -> bool:
    """Show by a lock that what is open is being written; False where somebody has removed it just before.

    The lock ends with the process. Where the system or the file system has no locks, nothing is shown.
    """
    if fcntl is not None:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
    return os.fstat(descriptor).st_nlink > 0


def remove_stale(folder: Path) -> None:
    """Remove what processes that were killed were writing in a folder and below; what is being written stays."""
    for name, folders, files in os.walk(folder):
        for left in [each for each in (*files, *folders) if _PART.fullmatch(each)]:
            with suppress(OSError):
                _remove_unless_held(Path(name, left))
        folders[:] = [each for each in folders if not _PART.fullmatch(each)]


def _remove_unless_held(path: Path) -> None:
    if fcntl is None or path.is_symlink():
        return
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
    finally:
        os.close(descriptor)


@contextmanager
def held_folder(path: Path) -> Iterator[Path]:
    """Make a folder beside `path` that is shown to be in use while the block runs, and remove it if it is still there.

    It has the rights that the process's umask leaves.
    """
    while True:
        made = partial_of(path)
        made.mkdir()
        try:
            descriptor = os.open(made, os.O_RDONLY) if fcntl is not None else -1
        except FileNotFoundError:  # another process has taken it for one that was left
            continue
        if descriptor < 0 or hold(descriptor):
            break
        os.close(descriptor)
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)
        if descriptor >= 0:
            os.close(descriptor)


def restore(path: Path) -> None:
    """Bring back the folder that `put` had moved aside when its process was killed, and remove what it was writing."""
    for left in [each for each in path.parent.iterdir() if each.name.startswith(f".{path.name}.")]:
        if _PART.fullmatch(left.name):
            with suppress(OSError):
                _remove_unless_held(left)
    if not path.exists() and _aside(path).is_dir():
        with suppress(OSError):
            _aside(path).replace(path)


def put(new: Path, path: Path) -> None:
    """Move a folder into the place of another, which is removed; at every moment one of them lies there, or aside.

    Raises:
        OSError: it cannot be done.
    """
    if not path.exists():
        new.replace(path)
    elif exchange(new, path):
        shutil.rmtree(new, ignore_errors=True)
    else:
        shutil.rmtree(_aside(path), ignore_errors=True)
        path.replace(_aside(path))
        new.replace(path)
        shutil.rmtree(_aside(path), ignore_errors=True)


def exchange(first: Path, second: Path) -> bool:
    """Swap two names in one step; False where the system or the file system cannot."""
    try:
        swap = ctypes.CDLL(None, use_errno=True).renameat2  # Linux, glibc 2.28 and later
    except (OSError, TypeError, AttributeError):
        return False
    return bool(swap(_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second), _RENAME_EXCHANGE) == 0)


def _aside(path: Path) -> Path:
    return path.with_name(f".{path.name}.aside")
