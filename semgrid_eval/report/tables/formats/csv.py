"""A table as CSV: a column for each of its own, and two more where there are intervals."""

import pandas as pd

from semgrid_eval.errors import printable
from semgrid_eval.report.tables.table import Cell, Table, heads, lines

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def as_csv(table: Table) -> str:
    """Write numbers as they are, other cells as their text."""
    corner, *names = heads(table)
    wide = [any(cells[at].interval for _, cells in lines(table)) for at in range(len(names))]
    columns = [corner]
    for name, has_interval in zip(names, wide, strict=True):
        columns += [name, f"{name} low", f"{name} high"] if has_interval else [name]
    values = [
        [header, *(value for cell, w in zip(cells, wide, strict=True) for value in _values(cell, has_interval=w))]
        for header, cells in lines(table)
    ]
    return frame_csv(pd.DataFrame(values, columns=columns))


def frame_csv(frame: pd.DataFrame) -> str:
    """Write a data frame as all CSV files of a report are written.

    Words that a spreadsheet would take for a formula have an apostrophe before them, as in spreadsheets themselves, and
    what cannot be printed is escaped.
    """
    # By place: two columns of a table may have one name.
    columns = [frame.iloc[:, at] for at in range(frame.shape[1])]
    safe = pd.concat([each.map(_word) if each.dtype.kind in "OTU" else each for each in columns], axis=1)
    safe.columns = [_word(name) for name in frame.columns]
    return safe.to_csv(index=False, float_format="%.6f", lineterminator="\n")


def _word(value: object) -> object:
    if not isinstance(value, str):
        return value
    text = printable(value)
    return f"'{text}" if value.startswith(_FORMULA) and not _is_number(text) else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _values(cell: Cell, *, has_interval: bool) -> list[object]:
    value = cell.text if cell.sort is None and cell.text.isascii() else cell.sort
    return [value, *(cell.interval or (None, None))] if has_interval else [value]
