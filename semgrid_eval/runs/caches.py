"""What is kept to be found again - grids, answers of the truth, simulated towns - and which of it nobody uses."""

import re
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.grids.build import grid_file, grid_key
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.scores.results import read_run
from semgrid_eval.sources.town.config import CACHE as TOWNS

DAY_S = 86_400.0
_TRUTH = re.compile(r"(?P<log>[^.].*)-truth-[0-9a-f]{16}\.npz")
_GRIDS = re.compile(r"[^.].*-[0-9a-f]{16}\.npz")
_TOWN = re.compile(r"town-[0-9a-f]{16}")
_PLACES = (".", "grids", TOWNS)
"""Where a folder has them: it is a cache itself, a run, or a folder of logs."""


@dataclass(frozen=True)
class Kept:
    """One thing that is kept: the grids or an answer of a log, or a town."""

    path: Path
    kind: str  # grids, truth or town
    size_bytes: int
    used_s: float  # when it was last read, as far as the file system tells, or written; seconds since 1970


@dataclass(frozen=True)
class Uses:
    """What runs read: names of files of grids, and names of logs, whose answers of the truth belong to them."""

    grids: frozenset[str]
    logs: frozenset[str]

    def __contains__(self, kept: Kept) -> bool:
        truth = _TRUTH.fullmatch(kept.path.name)
        return truth["log"] in self.logs if truth else kept.path.name in self.grids


def find_kept(folder: Path) -> list[Kept]:
    """List what a folder keeps: a folder of grids or of towns, a run's folder, or a folder of logs with its towns.

    Nothing is told by its content: grids are `LOG-<digest>.npz`, towns `town-<digest>` with a `town.json`.

    Raises:
        InputError: there is no such folder, or nothing of this kind in it.
    """
    if not folder.is_dir():
        raise InputError("is not a folder", path=folder)
    places = [folder / name for name in _PLACES if (folder / name).is_dir()]
    found = [kept for place in places for path in sorted(place.iterdir()) for kept in _kept(path)]
    if not found:
        raise InputError("keeps neither grids nor towns", path=folder)
    return found


def _kept(path: Path) -> Iterator[Kept]:
    if path.is_symlink():
        return
    if path.is_file() and _GRIDS.fullmatch(path.name):
        kind = "truth" if _TRUTH.fullmatch(path.name) else "grids"
        yield _measured(path, kind, [path])
    elif _TOWN.fullmatch(path.name) and (path / "town.json").is_file():
        yield _measured(path, "town", [file for file in path.rglob("*") if file.is_file()])


def _measured(path: Path, kind: str, files: Sequence[Path]) -> Kept:
    told = [file.stat() for file in files]
    used_s = max(max(each.st_atime, each.st_mtime) for each in told)
    return Kept(path, kind, sum(each.st_size for each in told), used_s)


def uses_of(runs: Sequence[Path]) -> Uses:
    """Find out what runs read, from their records.

    Raises:
        InputError: a record cannot be read, or its grids are of another version.
    """
    grids, logs = set[str](), set[str]()
    for run in runs:
        record = read_run(run)
        rows = record.matrix.get("rows")
        given = [row["grid"] for row in rows if "grid" in row] if isinstance(rows, list) else []
        configs = {str(each): parse_config(GridConfig, each, path=run / "run.json") for each in given}
        if not configs:
            raise InputError("does not tell which grids it uses", path=run / "run.json", field="matrix")
        logs |= {log.name for log in record.logs}
        keys = ((log, grid_key(log.digest, config)) for log in record.logs for config in configs.values())
        grids |= {grid_file(log.name, key) for log, key in keys}
    return Uses(frozenset(grids), frozenset(logs))


def unused(kept: Sequence[Kept], uses: Uses | None, older_than_s: float | None, now_s: float) -> list[Kept]:
    """Choose what can go: what no run uses, of that what was not used for so long; towns, which no run reads, by age.

    Without `uses` age alone decides, and without `older_than_s` use does, so that towns stay.
    """
    idle = [each for each in kept if older_than_s is None or now_s - each.used_s > older_than_s]
    towns = [each for each in idle if each.kind == "town" and older_than_s is not None]
    return towns + [each for each in idle if each.kind != "town" and (uses is None or each not in uses)]


def remove(kept: Kept) -> None:
    """Remove one thing that is kept.

    Raises:
        InputError: it cannot be removed.
    """
    try:
        shutil.rmtree(kept.path) if kept.path.is_dir() else kept.path.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be removed: {error.strerror or error}", path=kept.path) from error
