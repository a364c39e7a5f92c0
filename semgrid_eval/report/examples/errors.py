"""Maps of where on the grid each row errs: the share of windows in which a cell is predicted wrong."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import SemgridError
from semgrid_eval.report.examples.drawing import data_uri, share_png
from semgrid_eval.report.rows.load import Row
from semgrid_eval.scores.results import read_predictions, read_windows

FEWEST_WINDOWS = 3
"""A cell is shown where its class is known in at least so many windows."""


@dataclass(frozen=True)
class ErrorMap:
    """The map of one row as a picture, and its mean error over the cells that are shown."""

    name: str
    number: int
    uri: str
    mean: str  # in percent


@dataclass(frozen=True)
class ErrorMaps:
    """The maps of rows on one scale that ends at `highest`, in percent."""

    maps: tuple[ErrorMap, ...]
    highest: int


def error_maps(rows: Sequence[Row]) -> ErrorMaps:
    """Draw the map of every row that kept its predictions, of the seed that examples show."""
    read = lru_cache(1)(read_windows)  # rows that share windows are read one after the other
    shares = {}
    for row in sorted(rows, key=lambda row: row.window_set):
        with suppress(SemgridError, ValueError, IndexError):  # `failures` names what is damaged
            windows, predictions = read(*row.window_set), read_predictions(row.shown.folder)
            shares[row.name] = error_share(windows["target"], predictions["prediction"], windows["mask"] > 0)
    known = {name: share for name, share in shares.items() if np.isfinite(share).any()}
    highest = max((float(np.nanmax(share)) for share in known.values()), default=0.0)
    maps = (
        ErrorMap(
            row.name,
            row.number,
            data_uri(share_png(known[row.name] / max(highest, 1e-9))),
            f"{100 * np.nanmean(known[row.name]):.1f}%",
        )
        for row in rows
        if row.name in known
    )
    return ErrorMaps(tuple(maps), round(100 * highest))


def error_share(
    target: NDArray[np.uint8], prediction: NDArray[np.uint8], mask: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Share of windows in which a known cell is predicted wrong: three times (N, H, W) -> (H, W).

    Cells of mask M are left out; NaN where a cell is known in too few windows.
    """
    known = (target != UNKNOWN) & ~mask
    windows, wrong = known.sum(axis=0), (known & (prediction != target)).sum(axis=0)
    return np.where(windows >= FEWEST_WINDOWS, wrong / np.maximum(windows, 1), np.nan)
