"""Scores of parts of what was scored, side by side: tables for the page and one for machines."""

from collections.abc import Mapping, Sequence

import pandas as pd

from semgrid_eval.report.estimates.bootstrap import Estimate, Scores
from semgrid_eval.report.rows.pairing import reference_of
from semgrid_eval.report.tables.long import target_cells
from semgrid_eval.report.tables.scores import difference_table, value_table
from semgrid_eval.report.tables.table import ABSENT, Cell, Line, Table

Parts = Mapping[str, Scores]
"""Scores of rows by the name of the part."""

_NUMBERS = ("iou", "iou_low", "iou_high", "reference", "difference", "difference_low", "difference_high")


def part_values(name: str, caption: str, parts: Parts, columns: Sequence[str]) -> Table | None:
    """Show the scores of all parts beside each other; None where there are none."""
    values = {part: value_table("", "", scores, columns, beside_paper=False) for part, scores in parts.items()}
    return _side_by_side(name, caption, values, len(columns))


def part_differences(name: str, caption: str, parts: Parts, columns: Sequence[str]) -> Table | None:
    """Show rows' paired differences to their baselines alike."""
    tables = {part: difference_table("", scores, columns) for part, scores in parts.items()}
    return _side_by_side(name, caption, {part: table for part, table in tables.items() if table}, len(columns))


def part_frame(parts: Parts, label: str, columns: Sequence[str]) -> pd.DataFrame:
    """Return one line for each part, row and score, with the paired difference to the row's baseline."""
    lines: list[dict[str, object]] = []
    for part, scores in parts.items():
        rows = [entry.row for entry in scores.values()]
        for name, entry in scores.items():
            reference = reference_of(entry.row, rows)
            cells = target_cells(entry.row.results[0].counts)
            for column in columns:
                line: dict[str, object] = {
                    label: part,
                    "row": name,
                    "score": column,
                    **_numbers("iou", entry.estimate(column)),
                }
                if reference is not None:
                    gap = entry.minus(scores[reference.name], column)
                    line |= {"reference": reference.name, **_numbers("difference", gap)}
                evidence = {"seeds": len(entry.row.results), "windows": entry.row.windows, "cells": cells[column]}
                lines.append(line | evidence)
    return pd.DataFrame(lines, columns=[label, "row", "score", *_NUMBERS, "seeds", "windows", "cells"])


def _numbers(name: str, estimate: Estimate) -> dict[str, float]:
    return {name: estimate.value, f"{name}_low": estimate.low, f"{name}_high": estimate.high}


def _side_by_side(name: str, caption: str, parts: Mapping[str, Table], width: int) -> Table | None:
    """Join tables of that many columns by the headers of their lines, with dashes where one of them lacks a line."""
    if not parts:
        return None
    columns = tuple((label, f"{part}, {note}") for part, table in parts.items() for label, note in table.columns)
    lines = {part: {body[0].header: body[0] for body in table.bodies} for part, table in parts.items()}
    headers = dict.fromkeys(header for found in lines.values() for header in found)
    bodies = []
    for header in headers:
        absent = Line(header, (Cell(ABSENT),) * width)
        cells = tuple(cell for found in lines.values() for cell in found.get(header, absent).cells)
        bodies.append((Line(header, cells),))
    return Table(name, caption, next(iter(parts.values())).corner, columns, tuple(bodies))
