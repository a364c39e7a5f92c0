"""What a metric is, and what it sees: scored windows whose cells are divided into regions by partitions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.grids.spec import GridSpec

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]
Grid = NDArray[np.uint8]
Better = Literal["higher", "lower", ""]
"""Which of two values is the better one; empty where neither is."""


@dataclass(frozen=True)
class ScoredWindows:
    """N windows and what a model says of them."""

    target: Grid  # (N, H, W) class ids
    prediction: Grid  # (N, H, W) class ids, the mask M treated as the row asks
    certainty: Grid  # (N, H, W) of the prediction, 255 = 1
    left_out: NDArray[np.bool_]  # (N, H, W) bool, cells that do not count
    # (N, S, T, H, W) class ids, oldest first, moved into the target's place; None where windows have no inputs of one
    # time, as those of streams.
    inputs: Grid | None
    actors: Grid | None  # (N, H, W) flags of true actors, `STANDING` and `MOVING`; None where no log holds the truth
    spec: GridSpec  # extent of the grids
    classes: ClassSet = DEFAULT_CLASSES  # of their cells


@dataclass(frozen=True)
class Regions:
    """In which region each cell counts: `number` (N, H, W) from 0 to below `count`, -1 where it counts nowhere."""

    number: NDArray[np.integer]
    count: int

    def tally(self, codes: NDArray[np.integer], size: int) -> Counts:
        """Count cells by their code in each window and region: (N, H, W) below `size` -> (N, count, size).

        Cells with a negative code are left out.

        Raises:
            IndexError: a region or a code is too large.
        """
        total = np.zeros((len(codes), self.count, size), np.int64)
        _tally(self.number, codes, total)
        return total


@numba.njit(cache=True, nogil=True)
def _tally(region, code, total):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    windows, rows, columns = region.shape
    for window in range(windows):
        for row in range(rows):
            for column in range(columns):
                where, what = region[window, row, column], code[window, row, column]
                if where < 0 or what < 0:
                    continue
                if where >= total.shape[1] or what >= total.shape[2]:
                    raise IndexError("a region or a code is too large")
                total[window, where, what] += 1


@dataclass(frozen=True)
class Column:
    """One figure of a metric: its name, what it is called in words, and which of two values is the better one."""

    name: str
    label: str
    better: Better = "higher"
    limits: tuple[float, float] = (0.0, 1.0)  # no value lies outside, so no interval does


class Metric(Protocol):
    """Whole numbers that are counted in each window and can be summed over windows, and figures that follow from them.

    Sums have shape (..., *shape): of one window or many, of one region or many. Ratios have shape (..., K, 2): a
    numerator and a denominator for each of `ratio_names`, both linear in the sums, so that they can be summed as well.
    """

    name: str  # in files and columns
    title: str  # what its figures are, in words, at the start of a sentence
    shape: tuple[int, ...]  # of what is counted in one region of one window
    ratio_names: tuple[str, ...]  # of the K ratios
    columns: tuple[Column, ...]  # the Q figures
    shown: tuple[str, ...]  # the columns that a report shows where a partition asks for no others

    def count(self, scored: ScoredWindows, regions: Regions) -> Counts:
        """Count in each window and region: -> (N, regions, *shape)."""

    def ratios(self, sums: Counts) -> Counts:
        """Take numerators and denominators out of sums: (..., *shape) -> (..., K, 2)."""

    def figures(self, ratios: Counts) -> Floats:
        """Divide: (..., K, 2) -> (..., Q); NaN where there is nothing to divide by."""
        return divided(ratios[..., 0], ratios[..., 1])

    def cells(self, sums: Counts) -> Counts:
        """Count the cells that stand behind each figure: (..., *shape) -> (..., Q)."""


def column_names(metric: Metric) -> tuple[str, ...]:
    """Return the names of a metric's figures."""
    return tuple(column.name for column in metric.columns)


def places_of(metric: Metric, names: Sequence[str]) -> list[int]:
    """Find the places of figures among a metric's columns."""
    known = column_names(metric)
    return [known.index(name) for name in names]


def column_of(metric: Metric, name: str) -> Column:
    """Find a metric's figure by its name."""
    return next(column for column in metric.columns if column.name == name)


def divided(part: NDArray[np.number], whole: Counts) -> Floats:
    """Divide, NaN where there is nothing to divide by."""
    return np.asarray(np.divide(part, whole, out=np.full(whole.shape, np.nan), where=whole > 0))


def mean_finite(values: Floats, *, axis: int = -1) -> Floats:
    """Mean of the values along an axis that are there, NaN where none is."""
    return divided(np.nansum(values, axis=axis), np.isfinite(values).sum(axis=axis))


Shown = Callable[[Metric], Sequence[str]]
"""Chooses the columns of a metric that a report shows."""


def only(name: str) -> Shown:
    """Show of one metric its own choice, and of others nothing."""
    return lambda metric: metric.shown if metric.name == name else ()


CellNumbers = Callable[[ScoredWindows], NDArray[np.int64] | None]


@dataclass(frozen=True)
class Partition:
    """Cells of windows divided into regions.

    `number` numbers the region of each cell (N, H, W), -1 where it is in none; it returns None where windows do not
    tell. `shown` chooses the columns of a metric that a report shows, by default the metric's own choice.
    """

    name: str  # in files and columns
    regions: Sequence[str]  # their names, as a reader sees them
    words: str  # which cells the regions hold, to follow "IoU"; empty where it is all of them
    number: CellNumbers
    shown: Shown = lambda metric: metric.shown
    by_inputs: bool = False  # whether regions depend on a row's inputs, so that rows of other inputs have other cells
