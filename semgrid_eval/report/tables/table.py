"""What a table on the page is made of, and how numbers are written in it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from semgrid_eval.report.estimates.bootstrap import LEVEL, Estimate
from semgrid_eval.report.rows.pairing import verdict

Better = Literal["higher", "lower", ""]
"""Which of two values is the better one; empty where neither is."""
ABSENT = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"


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
    """One line of a table: its header, a kind for its style, and its cells."""

    header: str
    cells: tuple[Cell, ...]
    kind: str = ""
    title: str = ""


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


def number(value: float) -> str:
    """Write an IoU with three digits, a dash where it is absent."""
    return f"{value:.3f}" if math.isfinite(value) else ABSENT


def signed(value: float) -> str:
    """Write a difference with its sign; none at all has no sign."""
    if value == 0:
        return "0.000"
    return f"{value:+.3f}".replace("-", MINUS) if math.isfinite(value) else ABSENT


def interval(estimate: Estimate, *, with_sign: bool = False) -> str:
    """Write an interval, empty where there is none."""
    if not math.isfinite(estimate.low):
        return ""
    if with_sign:
        return f"{signed(estimate.low)} to {signed(estimate.high)}"
    return f"{number(estimate.low)}\N{EN DASH}{number(estimate.high)}"


def interval_phrase(estimate: Estimate, *, with_sign: bool = False) -> str:
    """Write an interval with its level, for sentences and tooltips."""
    text = interval(estimate, with_sign=with_sign)
    return f"{LEVEL:.0%} interval {text}" if text else "no interval"


def plural(count: int, noun: str) -> str:
    """Write a count with its noun."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def value_cell(estimate: Estimate, *, title: str = "", best: bool = False) -> Cell:
    """Show a score with its interval."""
    tone = "best" if best else ""
    return Cell(number(estimate.value), finite(estimate.value), interval(estimate), title, tone, _bounds(estimate))


def difference_cell(difference: Estimate, *, title: str = "", better: Better = "higher") -> Cell:
    """Show a difference with its interval, toned by its verdict."""
    note, tone = interval(difference, with_sign=True), _tone(difference, better)
    return Cell(signed(difference.value), finite(difference.value), note, title, tone, _bounds(difference))


def plain_cell(value: float, *, title: str = "") -> Cell:
    """Show a number without an interval."""
    return Cell(number(value), finite(value), title=title)


def finite(value: float) -> float | None:
    """Return a value, None where it is absent."""
    return value if math.isfinite(value) else None


def _bounds(estimate: Estimate) -> tuple[float, float] | None:
    return (estimate.low, estimate.high) if math.isfinite(estimate.low) else None


def _tone(difference: Estimate, better: Better) -> str:
    if better == "lower":
        difference = Estimate(-difference.value, -difference.high, -difference.low)
    return verdict(difference) if better else ""
