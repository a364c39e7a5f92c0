"""What a matrix comes down to: its distinct units, each a row with one seed, and those of the rows asked for."""

from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from semgrid_eval.errors import ConfigError
from semgrid_eval.files import digest_value
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.row import Row


class Unit(NamedTuple):
    """A row with one seed; `seed` is None where chance plays no part."""

    row: Row
    seed: int | None


def plan_units(matrix: Matrix) -> dict[str, Unit]:
    """List the distinct units of a matrix by key; rows that mean the same share them."""
    units: dict[str, Unit] = {}
    for row in matrix.rows:
        for key, unit in units_of(row, matrix.seed):
            units.setdefault(key, unit)
    return units


def units_of(row: Row, first_seed: int) -> Iterator[tuple[str, Unit]]:
    """Return the units of a row with the keys by which rows that mean the same share them."""
    model = row.found_model()
    seeds = range(first_seed, first_seed + row.repeats) if model and model.random else [None]
    for seed in seeds:
        yield digest_value([row.identity(), seed]), Unit(row, seed)


def wanted_rows(matrix: Matrix, only: Sequence[str]) -> list[Row]:
    """Return the rows that are asked for by names or patterns like `BL-*`, all of them where nothing is asked for.

    Raises:
        ConfigError: a name or pattern fits no row.
    """
    found = {pattern: [row for row in matrix.rows if _is_asked(row, pattern)] for pattern in only}
    for pattern, rows in found.items():
        if not rows:
            names = ", ".join(sorted(row.name for row in matrix.rows))
            raise ConfigError(f"{pattern!r} is not a row of this matrix: {names}", field="row")
    return [row for row in matrix.rows if not only or any(row in rows for rows in found.values())]


def wanted_keys(matrix: Matrix, only: Sequence[str]) -> set[str]:
    """Return the keys of the units of the rows that are asked for."""
    return {key for row in wanted_rows(matrix, only) for key, _ in units_of(row, matrix.seed)}


def _is_asked(row: Row, pattern: str) -> bool:
    """Tell whether a name or pattern means a row; a name may itself hold signs of patterns."""
    return row.name == pattern or fnmatchcase(row.name, pattern)
