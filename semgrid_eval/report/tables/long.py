"""The long tables of a report: a line for every figure with its interval, and one for every figure of every seed."""

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from semgrid_eval.report.estimates.bootstrap import Estimate, Everything, RowScores, Scores
from semgrid_eval.report.tables.table import finite
from semgrid_eval.report.tables.values import reference_scores
from semgrid_eval.scores.metrics.metric import column_names
from semgrid_eval.scores.tidy import FIGURE_COLUMNS

SUMMARY_COLUMNS = (
    *("row", "metric", "division", "region", "column", "value", "low", "high"),
    *("reference", "difference", "difference_low", "difference_high", "cells", "windows", "seeds"),
)
_DIFFERENCE = {"value": "difference", "low": "difference_low", "high": "difference_high"}

Records = Mapping[str, Mapping[str, Mapping[str, Mapping[str, dict[str, Any]]]]]
"""What machines may want to know of a row, by the names of metric, division, region and row."""
_Place = dict[str, str]
T = TypeVar("T")


def summary_frame(records: Records) -> pd.DataFrame:
    """Return one line for every figure of `division_records`."""
    lines = [
        {**place, "row": name, **record, "column": column, "cells": record["cells"][column]}
        | record["scores"][column]
        | {_DIFFERENCE[key]: value for key, value in record["differences"].get(column, {}).items()}
        for place, region in _regions(records)
        for name, record in region.items()
        for column in record["scores"]
    ]
    return pd.DataFrame(lines, columns=list(SUMMARY_COLUMNS))


def seed_frame(everything: Everything) -> pd.DataFrame:
    """Return one line for every figure of every row and seed."""
    parts = [_seeds(entry, place) for place, scores in _regions(everything) for entry in scores.values()]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(FIGURE_COLUMNS))


def division_records(everything: Everything) -> Records:
    """Return every figure with its interval and its difference to the row's baseline, for machines."""
    return {
        metric: {
            division: {
                region: {name: _record(entry, scores) for name, entry in scores.items()}
                for region, scores in parts.items()
            }
            for division, parts in divisions.items()
        }
        for metric, divisions in everything.items()
    }


def _regions(of: Mapping[str, Mapping[str, Mapping[str, T]]]) -> Iterator[tuple[_Place, T]]:
    for metric, divisions in of.items():
        for division, parts in divisions.items():
            for region, found in parts.items():
                yield {"metric": metric, "division": division, "region": region}, found


def _record(entry: RowScores, scores: Scores) -> dict[str, Any]:
    other, columns = reference_scores(entry, scores), column_names(entry.metric)
    return {
        "windows": entry.windows,
        "seeds": len(entry.results),
        "cells": entry.cells,
        "scores": {column: _estimate(entry.estimate(column)) for column in columns},
        "reference": None if other is None else other.row.name,
        "differences": {} if other is None else {column: _estimate(entry.minus(other, column)) for column in columns},
    }


def _estimate(estimate: Estimate) -> dict[str, float | None]:
    return {name: finite(value) for name, value in vars(estimate).items()}


def _seeds(entry: RowScores, place: _Place) -> pd.DataFrame:
    columns = column_names(entry.metric)
    seed = pd.array([result.record.seed for result in entry.results], dtype="Int64").repeat(len(columns))
    frame = pd.DataFrame({"seed": seed, "column": list(columns) * len(entry.results), "value": entry.by_seed.ravel()})
    cells = np.asarray(entry.metric.cells(entry.totals)).ravel()
    return frame.assign(row=entry.row.name, **place, cells=cells, windows=entry.windows)[list(FIGURE_COLUMNS)]
