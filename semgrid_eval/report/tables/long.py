"""The long-form tables of a report: one line for each row of the matrix, seed and class or category."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.report.estimates.bootstrap import CATEGORY_COLUMNS, COLUMNS, MERGED_COLUMNS, RowScores
from semgrid_eval.scores.iou import averaged_members, merged_members


def members() -> dict[str, tuple[int, ...]]:
    """Return the class ids behind each of `estimates.COLUMNS`."""
    table: dict[str, tuple[int, ...]] = {name: (index,) for index, name in enumerate(CLASS_NAMES)}
    table |= averaged_members() | {f"merged_{name}": ids for name, ids in merged_members().items()}
    return {name: table[name] for name in COLUMNS}


def class_table(scores: Sequence[RowScores]) -> pd.DataFrame:
    """Return the table with columns row, family, model, class, iou, windows, cells, seed."""
    return _long(scores, CLASS_NAMES, "class")


def category_table(scores: Sequence[RowScores]) -> pd.DataFrame:
    """Return the table with columns row, family, model, category, iou, windows, cells, seed."""
    return _long(scores, (*CATEGORY_COLUMNS, *MERGED_COLUMNS), "category")


def target_cells(counts: NDArray[np.integer]) -> dict[str, int]:
    """Count the target's cells outside M behind each of `estimates.COLUMNS`: from counts (N, C, C)."""
    cells = counts.sum(axis=(0, 2), dtype=np.int64)
    return {name: int(cells[list(ids)].sum()) for name, ids in members().items()}


def _long(scores: Sequence[RowScores], names: tuple[str, ...], kind: str) -> pd.DataFrame:
    lines = []
    for entry in scores:
        record = entry.row.record
        key = (entry.row.name, record.facts.family, record.facts.model)
        for result, values in zip(entry.row.results, entry.by_seed, strict=True):
            cells, seed = target_cells(result.counts), result.record.seed
            for name in names:
                iou = values[COLUMNS.index(name)]
                lines.append((*key, name, iou, len(result.counts), cells[name], seed))
    table = pd.DataFrame(lines, columns=["row", "family", "model", kind, "iou", "windows", "cells", "seed"])
    return table.astype({"iou": "float64", "windows": "int64", "cells": "int64", "seed": "Int64"})
