"""Scores near moving and near standing actors apart, for results whose logs hold the truth about them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from semgrid_eval.report.cells import ABSENT, Cell, Line, Table
from semgrid_eval.report.comparison import reference_of
from semgrid_eval.report.estimates import Estimate, Scores, score_rows
from semgrid_eval.report.longform import target_cells
from semgrid_eval.report.reading import Result, Row
from semgrid_eval.report.tables import difference_table, value_table
from semgrid_eval.scores.results import REGIONS

SHOWN = ("vehicles", "person", "bicycle")
"""What the page shows; `regions.csv` has the classes of vehicles and the category of small dynamic ones, too."""
_KEPT = ("vehicles", "car", "large_vehicle", "small_dynamic", "person", "bicycle")

_NUMBERS = ("iou", "iou_low", "iou_high", "reference", "difference", "difference_low", "difference_high")
_COLUMNS = ("region", "row", "score", *_NUMBERS, "seeds", "windows", "cells")


def score_regions(rows: Sequence[Row], seed: int) -> dict[str, Scores]:
    """Score rows near `moving` and near `standing` actors alone; a region that no result knows is left out."""
    found: dict[str, Scores] = {}
    for region in REGIONS:
        near = (_row_near(row, region) for row in rows)
        scores = score_rows([row for row in near if row.results], np.random.default_rng(seed))
        if scores:
            found[region] = scores
    return found


def region_tables(regions: Mapping[str, Scores]) -> dict[str, Table | None]:
    """Show scores by region side by side, and the paired differences of rows to their baselines alike."""
    values = {name: value_table("", "", scores, SHOWN, beside_paper=False) for name, scores in regions.items()}
    differences = {
        name: table for name, scores in regions.items() if (table := difference_table("", scores, SHOWN)) is not None
    }
    value_caption = "IoU of the cells near moving and near standing actors, with 95% interval. Best of each in bold."
    caption = (
        "Differences to the baseline near such actors, resampled together. Marked where the interval excludes zero."
    )
    return {
        "regions": _side_by_side("regions", value_caption, values),
        "region_differences": _side_by_side("region-differences", caption, differences),
    }


def region_frame(regions: Mapping[str, Scores]) -> pd.DataFrame:
    """Return one line for each region, row and score, with the paired difference to the row's baseline."""
    lines: list[dict[str, object]] = []
    for region, scores in regions.items():
        rows = [entry.row for entry in scores.values()]
        for name, entry in scores.items():
            reference = reference_of(entry.row, rows)
            cells = target_cells(entry.row.results[0].counts)
            for column in _KEPT:
                line: dict[str, object] = {
                    "region": region,
                    "row": name,
                    "score": column,
                    **_numbers("iou", entry.estimate(column)),
                }
                if reference is not None:
                    gap = entry.minus(scores[reference.name], column)
                    line |= {"reference": reference.name, **_numbers("difference", gap)}
                evidence = {"seeds": len(entry.row.results), "windows": entry.row.windows, "cells": cells[column]}
                lines.append(line | evidence)
    return pd.DataFrame(lines, columns=list(_COLUMNS))


def _numbers(name: str, estimate: Estimate) -> dict[str, float]:
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def _row_near(row: Row, region: str) -> Row:
    """Take a row's counts near such actors alone; results without the truth are left out."""
    return replace(row, results=tuple(_near(each, region) for each in row.results if region in each.regions))


def _near(result: Result, region: str) -> Result:
    """Keep the windows that have such actors, so that the number of windows is that of the evidence."""
    counts = result.regions[region]
    used = np.asarray(counts.sum(axis=(1, 2)) > 0)
    windows = tuple(window for window, kept in zip(result.record.windows, used, strict=True) if kept)
    return replace(result, counts=counts[used], record=result.record.model_copy(update={"windows": windows}))


def _side_by_side(name: str, caption: str, parts: Mapping[str, Table]) -> Table | None:
    """Join tables by the headers of their lines; a line that one of them lacks has dashes there."""
    if not parts:
        return None
    columns = tuple((label, f"{part}, {note}") for part, table in parts.items() for label, note in table.columns)
    lines = {part: {body[0].header: body[0] for body in table.bodies} for part, table in parts.items()}
    headers = dict.fromkeys(header for found in lines.values() for header in found)
    bodies = []
    for header in headers:
        absent = Line(header, (Cell(ABSENT),) * len(SHOWN))
        cells = tuple(cell for found in lines.values() for cell in found.get(header, absent).cells)
        bodies.append((Line(header, cells),))
    return Table(name, caption, next(iter(parts.values())).corner, columns, tuple(bodies))
