"""How a matrix is run, and what it comes down to: its distinct units, each a row with one seed."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

from semgrid_eval.errors import ConfigError
from semgrid_eval.executors import Executor, InProcess
from semgrid_eval.files import digest_value
from semgrid_eval.runs.matrix import Matrix
from semgrid_eval.runs.row import Row


@dataclass(frozen=True)
class RunOptions:
    """How a matrix is run; but for the logs to score, nothing here changes its numbers on one machine.

    Args:
        device: `auto`, `cpu`, `cuda`, `cuda:1`, ...
        grids: folder in which grids are kept.
        command: how the run was started, for the record.
        only: names or patterns of the rows to work on, all where it is empty; what others have is kept on record.
        executor: where rows are trained and scored.
        grid_executor: where grids are built and pictures made small.
        validation_logs: folder of the logs to score, where they are not among those to train on.
        trainings: folder of the trainings, the run's own if not given; what another run has trained is found there.
        pictures: whether to keep small pictures of the windows' frames for the report.
    """

    device: str
    grids: Path
    command: str
    only: tuple[str, ...] = ()
    executor: Executor = field(default_factory=InProcess)
    grid_executor: Executor = field(default_factory=InProcess)
    pictures: bool = True
    validation_logs: Path | None = None
    trainings: Path | None = None


class Unit(NamedTuple):
    """A row with one seed; `seed` is None where chance plays no part."""

    row: Row
    seed: int | None


def plan_units(rows: Iterable[Row], first_seed: int) -> dict[str, Unit]:
    """List the distinct units of rows by key; rows that mean the same share them."""
    units: dict[str, Unit] = {}
    for row in rows:
        for key, unit in units_of(row, first_seed):
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
    # A name may itself hold signs of patterns.
    found = {each: [row for row in matrix.rows if row.name == each or fnmatchcase(row.name, each)] for each in only}
    for pattern, rows in found.items():
        if not rows:
            names = ", ".join(sorted(row.name for row in matrix.rows))
            raise ConfigError(f"{pattern!r} is not a row of this matrix: {names}", field="row")
    return [row for row in matrix.rows if not only or any(row in rows for rows in found.values())]
