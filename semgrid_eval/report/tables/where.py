"""Where a row is right: by distance, by what the inputs had seen of a cell, and by how certain the model was."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, KNOWN_IDS, UNKNOWN
from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.report.rows.load import Row, WindowReader
from semgrid_eval.scores.calibration import LEVELS, certainty_counts, expected_calibration_error, reliability
from semgrid_eval.scores.iou import category_iou, class_iou
from semgrid_eval.scores.results import read_predictions, read_windows

Grid = NDArray[np.uint8]
Counts = NDArray[np.int64]

BAND_EDGES_M = (20.0, 40.0, 60.0)
BANDS = ("0 to 20 m", "20 to 40 m", "40 to 60 m", "beyond 60 m")
ORIGINS = ("in the newest input", "in an older input only", "in no input")
_CHUNK = 64


@dataclass(frozen=True)
class Where:
    """Counts of one row's shown result: cells (bands, origins, C, C) and certainty (256 levels, wrong and right)."""

    row: Row
    cells: Counts
    certainty: Counts

    def band_scores(self) -> NDArray[np.float64]:
        """Mean class IoU without `unknown` in each band of distance: (bands,)."""
        return category_iou(class_iou(self.cells.sum(axis=1)))["mean_known"]

    def origin_shares(self) -> NDArray[np.float64]:
        """Share of right cells among those the target knows, by what the inputs had seen of them: (origins,)."""
        known = self.cells.sum(axis=0)[:, KNOWN_IDS]  # (origins, C - 1, C)
        right = np.trace(known[:, :, KNOWN_IDS], axis1=1, axis2=2)
        total = known.sum(axis=(1, 2))
        return np.asarray(np.divide(right, total, out=np.full(len(ORIGINS), np.nan), where=total > 0))

    def calibration(self) -> pd.DataFrame:
        """Columns certainty, right, cells: mean certainty and share of right cells in each bin that has cells."""
        table = pd.DataFrame(vars(reliability(self.certainty)))
        return table[table.cells > 0].reset_index(drop=True)

    def calibration_error(self) -> float:
        """Mean distance between certainty and share of right cells, weighted by cells."""
        return expected_calibration_error(self.certainty)


def locate_rows(rows: Iterable[Row]) -> tuple[list[Where], list[str]]:
    """Count where each row is right, and say of which rows the arrays cannot be read."""
    rows = list(rows)
    read = lru_cache(1)(read_windows)  # rows that share windows come one after the other
    found: dict[str, Where] = {}
    problems: dict[str, str] = {}
    for row in sorted(rows, key=lambda row: row.window_set):
        try:
            found[row.name] = locate_row(row, read)
        except (SemgridError, ValueError, IndexError) as error:
            problems[row.name] = f"{row.name}: {error}"
    names = [row.name for row in rows]
    return [found[name] for name in names if name in found], [problems[name] for name in names if name in problems]


def locate_row(row: Row, read: WindowReader = read_windows) -> Where:
    """Count where a row is right.

    Raises:
        ResultError: the windows or the predictions cannot be read.
        ValueError: their shapes differ.
    """
    result = row.shown
    shown = read(*row.window_set)
    mine = read_predictions(result.folder)
    inputs, target = np.asarray(shown["inputs"], np.uint8), np.asarray(shown["target"], np.uint8)
    mask = np.asarray(shown["mask"], np.bool_)
    prediction, certainty = (np.asarray(mine[name], np.uint8) for name in ("prediction", "certainty"))
    spec = result.spec
    if not (len(target), spec.rows, spec.columns) == target.shape == prediction.shape == certainty.shape == mask.shape:
        raise ValueError(f"shapes of windows {target.shape}, predictions {prediction.shape} or the grid differ")
    bands = bands_of(spec)
    cells = np.zeros((len(BANDS), len(ORIGINS), CLASS_COUNT, CLASS_COUNT), np.int64)
    levels = np.zeros((LEVELS, 2), np.int64)
    for start in range(0, len(target), _CHUNK):
        part = slice(start, start + _CHUNK)
        cells += count_cells(inputs[part], target[part], prediction[part], mask[part], bands)
        levels += certainty_counts(target[part], prediction[part], certainty[part], mask[part])
    return Where(row, cells, levels)


def bands_of(spec: GridSpec) -> NDArray[np.int64]:
    """Number the band of each cell by its distance from the vehicle: -> (H, W)."""
    forward_m, left_m = spec.centres_m()
    return np.asarray(np.digitize(np.hypot(forward_m[:, None], left_m), BAND_EDGES_M), np.int64)


def count_cells(
    inputs: Grid, target: Grid, prediction: Grid, mask: NDArray[np.bool_], bands: NDArray[np.int64]
) -> Counts:
    """Count cells outside M: inputs (N, S, T, H, W), grids (N, H, W), bands (H, W) -> (bands, origins, C, C)."""
    seen = (inputs != UNKNOWN).any(axis=1)  # (N, T, H, W)
    origin = np.where(seen[:, -1], 0, np.where(seen.any(axis=1), 1, 2))
    index = bands * len(ORIGINS) + origin
    index = (index * CLASS_COUNT + target) * CLASS_COUNT + prediction
    shape = (len(BANDS), len(ORIGINS), CLASS_COUNT, CLASS_COUNT)
    return np.asarray(np.bincount(index[~mask], minlength=int(np.prod(shape))).reshape(shape), np.int64)
