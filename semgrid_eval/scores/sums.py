"""The files of a result that hold what metrics counted: `sums.npz`, and `expected.npz` against the expected target."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.errors import ResultError
from semgrid_eval.scores.metrics.table import METRICS, Sums, metrics_of
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.words import plural

SUMS_FILE, EXPECTED_FILE = "sums.npz", "expected.npz"


def write_sums(folder: Path, sums: Sums, result_id: str = "", file: str = SUMS_FILE) -> None:
    """Write what every metric counted in a result's windows; the folder has its id as a name, if not given.

    `file` is `EXPECTED_FILE` for that target.
    """
    arrays = {".".join(key): array for key, array in sums.items()}
    write_arrays(folder / file, arrays, owner=_owner_of_sums(result_id or folder.name, file))


def read_sums(
    folder: Path,
    metric: str,
    partition: str,
    classes: ClassSet = DEFAULT_CLASSES,
    *,
    file: str = SUMS_FILE,
    verify: bool = True,
) -> NDArray[np.int32] | None:
    """Read what a metric counted by a partition: (N, regions, ...); None where the windows do not tell the regions.

    `classes` are the result's. Who has called `check_sums` before need not `verify` the file each time.
    """
    return _read_sums(folder / file, [(metric, partition)], classes, verify=verify).get((metric, partition))


def check_sums(folder: Path, windows: int, classes: ClassSet = DEFAULT_CLASSES, *, has_expected: bool = False) -> None:
    """Read everything that was counted, and forget it; a ResultError says what is missing or malformed."""
    for file in (SUMS_FILE, EXPECTED_FILE) if has_expected else (SUMS_FILE,):
        for key, found in _read_sums(folder / file, list(product(METRICS, PARTITIONS)), classes).items():
            if len(found) != windows:
                fault = f"has {plural(len(found), 'window')}, and result.json {windows}"
                raise ResultError(fault, path=folder / file, field=".".join(key))


def _owner_of_sums(result_id: str, file: str) -> str:
    """Return whose seal the sums have: those against the expected target cannot stand in for the others."""
    return f"{result_id}:expected" if file == EXPECTED_FILE else result_id


def _read_sums(
    path: Path, keys: Sequence[tuple[str, str]], classes: ClassSet, *, verify: bool = True
) -> dict[tuple[str, str], NDArray[np.int32]]:
    names, metrics = {key: ".".join(key) for key in keys}, metrics_of(classes)
    needed = tuple(name for key, name in names.items() if key[1] == "all")
    optional = tuple(name for name in names.values() if name not in needed)
    owner = _owner_of_sums(path.parent.name, path.name)
    found = read_arrays(path, needed, owner=owner, optional=optional, verify=verify)
    sums = {key: found[name] for key, name in names.items() if name in found}
    for (metric, partition), counted in sums.items():
        shape = (len(PARTITIONS[partition].regions), *metrics[metric].shape)
        if counted.shape[1:] != shape or counted.dtype != np.int32 or counted.min(initial=0) < 0:
            fault = f"has shape {counted.shape}, type {counted.dtype}, or is negative"
            raise ResultError(fault, path=path, field=names[metric, partition])
    return sums
