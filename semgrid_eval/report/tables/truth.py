"""Tables of what the truth tells: shares of the way to the ceiling, scores against what is measured on average."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, shared_iou
from semgrid_eval.report.estimates.way import Order, Way, ways
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import HEADLINE, verdict
from semgrid_eval.report.tables.numbers import ABSENT, MINUS, finite, interval_phrase, number
from semgrid_eval.report.tables.table import Cell, Line, Table
from semgrid_eval.report.tables.values import value_table
from semgrid_eval.words import plural

_MOST_PAIRS = 4
_WAY = (
    "Share of the way from {lower} to {upper} that each row has covered, (row − lower) / (upper − lower), "
    "all resampled together, with 95% interval: of all cells, and of cells near moving actors."
)
_EXPECTED = (
    "Category scores of the same predictions against what is measured on average: in each cell, the class that most of "
    "several new draws of the errors on the exact pictures have. With 95% interval; best of each column in bold."
)


def way_table(scores: Scores, moving: Scores, rows: Sequence[Row]) -> Table | None:
    """Show the share of the way of every row that has one: by category, and near moving actors; None where none has."""
    iou = shared_iou(scores.values())
    columns = [(iou.labels[column], "all cells") for column in iou.compared]
    columns += [(iou.labels[column], "near moving actors") for column in iou.moving]
    near = {entry.row.name: (entry, way) for entry, way in ways(moving, rows)}
    found, lines = list(ways(scores, rows)), []
    for entry, way in found:
        cells = [_share(entry, way, column) for column in iou.compared]
        there = near.get(entry.row.name)
        cells += [_share(*there, column) if there else Cell(ABSENT) for column in iou.moving]
        kind = "truth" if entry.row.uses_truth else ""
        lines.append((Line(entry.row.name, tuple(cells), kind, entry.row.record.label, (entry.row.number,)),))
    lower = ", ".join(dict.fromkeys(way.lower.row.name for _, way in found))
    upper = ", ".join(dict.fromkeys(way.upper.row.name for _, way in found))
    caption = _WAY.replace("{lower}", lower).replace("{upper}", upper)
    return Table("way", caption, "Row", tuple(columns), tuple(lines)) if lines else None


def expected_table(expected: Scores, order: Order) -> Table:
    """Show scores against what is measured on average, and each row's place there and before."""
    table = value_table("expected", _EXPECTED, expected, shared_iou(expected.values()).compared)
    places = _places(order)
    bodies = tuple(
        (replace(line, cells=(*line.cells, places.get(line.header, Cell(ABSENT)))),) for (line,) in table.bodies
    )
    return replace(table, columns=(*table.columns, ("Place", "by the mean")), bodies=bodies)


def order_sentence(measured: Scores, expected: Scores, order: Order) -> str:
    """Say whether the order of rows by the mean over classes is another one against what is measured on average."""
    count = len(order.measured)
    if count < 2:
        return ""
    if not order.swapped:
        return f"The order of the {count} rows by mean class IoU stays the same."
    shown = [f"{a} and {b}" for a, b in order.swapped[:_MOST_PAIRS]]
    more = len(order.swapped) - len(shown)
    pairs = "; ".join(shown) + (f"; and {plural(more, 'more pair')}" if more else "")
    clear = [pair for pair in order.swapped if any(_is_clear(each, pair) for each in (measured, expected))]
    words = f"{len(clear) or 'none'} of them clearly different against at least one of the targets"
    return f"The order of the {count} rows by mean class IoU changes: {pairs} change places ({words})."


def _is_clear(scores: Scores, pair: tuple[str, str]) -> bool:
    first, second = (scores[name] for name in pair)
    return verdict(first.minus(second, HEADLINE)) != "open"


def _places(order: Order) -> Mapping[str, Cell]:
    before = {name: place for place, name in enumerate(order.measured, start=1)}
    return {name: Cell(str(i), i, f"measured {before[name]}") for i, name in enumerate(order.expected, start=1)}


def _share(entry: RowScores, way: Way, column: str) -> Cell:
    share = way.share(entry, column)
    ends = [f"{each.row.name} {number(each.mean[column])}" for each in (way.lower, way.upper)]
    title = f"{entry.row.name} {number(entry.mean[column])}, from {ends[0]} to {ends[1]}"
    if finite(share.value) is None:
        return Cell(ABSENT, title=title)
    bounds = (share.low, share.high) if finite(share.low) is not None else None
    note = f"{percent(share.low)} to {percent(share.high)}" if bounds else ""
    return Cell(percent(share.value), share.value, note, f"{title}; {interval_phrase(share)}", interval=bounds)


def percent(share: float) -> str:
    """Write a share in percent."""
    return f"{round(100 * share)}%".replace("-", MINUS)


def way_sentence(scores: Scores, row: Row | None) -> str:
    """Say how far a row has come in the mean over classes; empty where it is not known."""
    for entry, way in ways(scores):
        share = way.share(entry, HEADLINE)
        if row is not None and entry.row.name == row.name and finite(share.value) is not None:
            top = f"Knowing the world exactly gives {number(way.upper.mean[HEADLINE])} ({way.upper.row.name})"
            return f"{top}: {row.name} has covered {percent(share.value)} of the way there from {way.lower.row.name}."
    return ""
