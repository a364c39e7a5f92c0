"""Watches a run's folder while code of one's own runs: what is no longer whole after it is named."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.models.checkpoint import CHECKPOINT_FILE, WEIGHTS_FILE, read_header
from semgrid_eval.scores import results

_SHOWN = 3


@contextmanager
def unchanged(folder: Path, name: str) -> Iterator[None]:
    """Make sure that what was complete in a run's folder is so after the block.

    Others may work on the same folder meanwhile: what they make again is whole.

    Raises:
        InputError: something is not; the text begins with the name of a model, and has what the block raised.
    """
    before = _complete(folder)
    try:
        yield
    except Exception as error:
        if changes := _changes(folder, before):
            raise InputError(f"{changes}, and ended with {type(error).__name__}: {error}", field=name) from error
        raise
    if changes := _changes(folder, before):
        raise InputError(changes, field=name)


def _complete(folder: Path) -> dict[Path, object]:
    """Find what nobody has a reason to change, and how it looks: results, windows, grids, finished trainings."""
    places = [path for kind in _IS_WHOLE for path in (folder / kind).glob("[!.]*")]
    finished = (path for path in places if path.parent.name != "trainings" or _is_finished(path))
    return {path: _look(path) for path in finished}


def _is_finished(training: Path) -> bool:
    return (training / WEIGHTS_FILE).exists() and not (training / CHECKPOINT_FILE).exists()


def _changes(folder: Path, before: dict[Path, object]) -> str:
    """Name what looks otherwise now and is not whole; nothing where all is."""
    found = [path for path, look in before.items() if _look(path) != look and not _IS_WHOLE[path.parent.name](path)]
    if not found:
        return ""
    names = [str(path.relative_to(folder)) for path in found[:_SHOWN]]
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return f"changed or removed {', '.join(names)}{more} in the run's folder"


def _look(path: Path) -> object:
    """Note number, size and time of a file, or of those in a folder."""
    try:
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        stats = [(file.name, file.stat()) for file in files if not file.name.startswith(".")]
    except OSError:
        return None
    return [(name, found.st_ino, found.st_size, found.st_mtime_ns) for name, found in stats]


def _reads(read: Callable[[Path], object]) -> Callable[[Path], bool]:
    def is_whole(path: Path) -> bool:
        try:
            read(path)
        except InputError:
            return False
        return True

    return is_whole


_IS_WHOLE: dict[str, Callable[[Path], bool]] = {
    "results": results.is_done,
    "windows": _reads(lambda path: results.read_windows(path.parent.parent, path.stem)),
    "trainings": lambda path: _reads(read_header)(path / WEIGHTS_FILE),
    "grids": lambda path: False,  # no run makes one again that was there
}
