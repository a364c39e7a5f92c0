"""What a table on the page is made of, and what its formats in files share."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from semgrid_eval.errors import printable
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.pairing import verdict
from semgrid_eval.report.tables.numbers import finite, interval, number, signed
from semgrid_eval.scores.metrics.metric import Better


@dataclass(frozen=True)
class Cell:
    """One cell: its text, the value that it sorts by, a small second line, a tooltip, a tone and an interval."""

    text: str
    sort: float | None = None
    note: str = ""
    title: str = ""
    tone: str = ""
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Line:
    """One line of a table: its header, its cells, a kind for its style, a tooltip, numbers of rows that it is about."""

    header: str
    cells: tuple[Cell, ...]
    kind: str = ""
    title: str = ""
    rows: tuple[int, ...] = ()


@dataclass(frozen=True)
class Table:
    """A table: each body is a group of lines that stay together when the table is sorted by their first line."""

    name: str
    caption: str
    corner: str
    columns: tuple[tuple[str, str], ...]  # label and small second line
    bodies: tuple[tuple[Line, ...], ...]


def plain_table(name: str, caption: str, corner: str, columns: Sequence[str], lines: Sequence[Line]) -> Table:
    """Make a table whose columns have no second line and whose lines stand alone."""
    return Table(name, caption, corner, tuple((column, "") for column in columns), tuple((line,) for line in lines))


def value_cell(estimate: Estimate, *, title: str = "", best: bool = False) -> Cell:
    """Show a score with its interval."""
    tone = "best" if best else ""
    return Cell(number(estimate.value), finite(estimate.value), interval(estimate), title, tone, _bounds(estimate))


def difference_cell(difference: Estimate, *, title: str = "", better: Better = "higher") -> Cell:
    """Show a difference with its interval, toned by its verdict."""
    lower = Estimate(-difference.value, -difference.high, -difference.low)
    tone = {"higher": verdict(difference), "lower": verdict(lower), "": ""}[better]
    note = interval(difference, with_sign=True)
    return Cell(signed(difference.value), finite(difference.value), note, title, tone, _bounds(difference))


def _bounds(estimate: Estimate) -> tuple[float, float] | None:
    return (estimate.low, estimate.high) if math.isfinite(estimate.low) else None


def one_line(text: str) -> str:
    """Turn what ends a line into spaces, and escape what cannot be printed."""
    return printable(" ".join(text.split()))


def heads(table: Table) -> list[str]:
    """Return the headers of all columns, with the region of each where there are several."""
    several = len(dict(table.columns)) < len(table.columns)
    parts = ((label, note.rpartition(", ")[0]) for label, note in table.columns)
    return [table.corner, *(f"{label} ({part})" if several and part else label for label, part in parts)]


def lines(table: Table) -> Iterator[tuple[str, tuple[Cell, ...]]]:
    """Go through the lines; the header of one that belongs to another names that one, too."""
    for body in table.bodies:
        for line in body:
            yield line.header if line is body[0] else f"{body[0].header}: {line.header}", line.cells
