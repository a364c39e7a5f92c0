"""A report in the place of an earlier one: what in its folder is not the report's stays."""

import os
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_json
from semgrid_eval.report.page.exports import FILES, PAGE, RECORD


def check_replaceable(out: Path) -> None:
    """Make sure that a folder is missing, empty or a report.

    Raises:
        InputError: it is something else.
    """
    if not out.exists():
        return
    is_report = (out / RECORD).is_file() and (out / PAGE).is_file()
    if not out.is_dir() or (any(out.iterdir()) and not is_report):
        raise InputError("exists and is not a report; name another folder", path=out, field="out")


def keep_foreign(out: Path, new: Path) -> None:
    """Give a report that is to take the place of `out` the files there that are not the earlier report's.

    Raises:
        InputError: one of them has the name of a file of the new report.
    """
    for path in _foreign(out):
        name = path.relative_to(out)
        place = new / name
        if os.path.lexists(place):
            message = "is not the earlier report's, and the new one has a file of this name; move it away"
            raise InputError(message, path=path)
        place.parent.mkdir(parents=True, exist_ok=True)
        _twin(path, place)


def _foreign(out: Path) -> Iterator[Path]:
    if not out.is_dir():
        return
    own = {PAGE, RECORD, *_listed(out / RECORD)}
    for folder, folders, files in os.walk(out):
        links = [name for name in folders if Path(folder, name).is_symlink()]
        for path in (Path(folder, name) for name in (*files, *links)):
            if str(path.relative_to(out)) not in own:
                yield path


def _listed(record: Path) -> list[str]:
    with suppress(InputError):
        found = read_json(record)
        names = found.get(FILES) if isinstance(found, dict) else None
        return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
    return []


def _twin(path: Path, place: Path) -> None:
    """Let a file have a second name, so that it is never without one; where there are no such links, copy it."""
    try:
        place.hardlink_to(path)
    except OSError:
        shutil.copy2(path, place, follow_symlinks=False)
