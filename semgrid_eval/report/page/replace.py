"""A report in the place of an earlier one: what in its folder is not the report's stays."""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_json
from semgrid_eval.report.page.exports import FILES, PAGE, RECORD

_NUMBERS = "summary|expected|scores|findings|streams|calibration|settings|training|timings|windows"
_TOP = re.compile(rf"index\.html|report\.json|matrix(-\d+)?\.yaml|leads\.json|({_NUMBERS})\.csv|summary\.(md|tex)")
"""Names beside the page that a report may have now."""
_EARLIER = re.compile(
    r"(architecture|categories|classes|paces|regions|where)\.csv|figures/[^/]+\.(png|svg)|tables/[^/]+\.(csv|json|md|tex)"
)
"""Names that reports had which did not list their files."""


def check_replaceable(out: Path) -> None:
    """Make sure that a folder is missing, empty or a report, and that a report of today can take its place.

    Raises:
        InputError: it is something else, or a file that is not the report's has a name that the new one needs.
    """
    if not out.exists():
        return
    is_report = (out / RECORD).is_file() and (out / PAGE).is_file()
    if not out.is_dir() or (any(out.iterdir()) and not is_report):
        raise InputError("exists and is not a report; name another folder", path=out, field="out")
    for path in _foreign(out):
        if _TOP.fullmatch(path.relative_to(out).as_posix()):
            raise _in_the_way(path)


def keep_foreign(out: Path, new: Path) -> None:
    """Give a report that is to take the place of `out` the files there that are not the earlier report's.

    Raises:
        InputError: one of them has the name of a file of the new report.
    """
    for path in _foreign(out):
        place = new / path.relative_to(out)
        if os.path.lexists(place):
            raise _in_the_way(path)
        place.parent.mkdir(parents=True, exist_ok=True)
        _twin(path, place)


def _in_the_way(path: Path) -> InputError:
    message = "is not the earlier report's, and the new one has a file of this name; move it away"
    return InputError(message, path=path)


def _foreign(out: Path) -> Iterator[Path]:
    if not out.is_dir():
        return
    is_own = _ownership(out / RECORD)
    for folder, folders, files in os.walk(out):
        links = [name for name in folders if Path(folder, name).is_symlink()]
        for path in (Path(folder, name) for name in (*files, *links)):
            if not is_own(str(path.relative_to(out))):
                yield path


def _ownership(record: Path) -> Callable[[str], object]:
    """Return what tells by its name whether a file is a report's: its list, or what reports without one wrote."""
    with suppress(InputError):
        found = read_json(record)
        if isinstance(found, dict) and isinstance(names := found.get(FILES), list):
            return {PAGE, RECORD, *(name for name in names if isinstance(name, str))}.__contains__
        if isinstance(found, dict) and "semgrid_eval" in found:
            return lambda name: _TOP.fullmatch(name) or _EARLIER.fullmatch(name)
    return {PAGE, RECORD}.__contains__


def _twin(path: Path, place: Path) -> None:
    """Let a file have a second name, so that it is never without one; where there are no such links, copy it."""
    try:
        place.hardlink_to(path)
    except OSError:
        shutil.copy2(path, place, follow_symlinks=False)
