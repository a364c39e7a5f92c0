"""A table as JSON: what it is called, its columns, and its lines with values and intervals."""

import json
from typing import Any

from semgrid_eval.report.tables.table import Cell, Table, heads, lines


def as_json(table: Table) -> str:
    """Write a table with all that machines may want of its cells."""
    record = {
        "name": table.name,
        "caption": table.caption,
        "columns": heads(table),
        "lines": [{"header": header, "cells": [_cell(cell) for cell in cells]} for header, cells in lines(table)],
    }
    return json.dumps(record, indent=2, allow_nan=False) + "\n"


def _cell(cell: Cell) -> dict[str, Any]:
    found: dict[str, Any] = {"text": cell.text, "value": cell.sort, "verdict": cell.tone, "evidence": cell.title}
    return found | ({"low": cell.interval[0], "high": cell.interval[1]} if cell.interval else {})
