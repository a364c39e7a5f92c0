"""Which rows cannot be compared, since their targets are others, and why."""

from collections.abc import Sequence

import numpy as np

from semgrid_eval.report.estimates.bootstrap import Scores
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import changed_settings, changed_targets, main_group, settings_of, shared_windows
from semgrid_eval.report.tables.numbers import ABSENT
from semgrid_eval.report.tables.table import Cell, Line, Table, plain_table

_MOST_NAMES = 3


def not_compared_table(scores: Scores) -> Table | None:
    """List the rows whose targets are others than those of the main group, and what makes them so."""
    rows = [entry.row for entry in scores.values()]
    if len({row.targets for row in rows}) < 2:
        return None
    main, with_main, groups = _by_targets(rows)
    caption = (
        f"Not compared with {main.name} and the rows that share its targets. Scores are subtracted only between "
        "rows with the same targets: the same frames of the same logs, grid, mask mode and split."
    )
    lines = [_other_targets(group, with_main) for group in groups]
    columns = ("What differs", "Windows", "Known of a target")
    return plain_table("not-compared", caption, "Rows with the same targets", columns, lines)


def not_compared_sentence(rows: Sequence[Row]) -> str:
    """Say which rows have other targets than those of the main group, and what makes them so; empty where none has."""
    _, with_main, groups = _by_targets(rows)
    told = "; ".join(f"{_named(group)} ({', '.join(_what_differs(group[0], with_main)[1])})" for group in groups)
    return f"Not compared with these, since their targets are others: {told}." if told else ""


def fusion_sentence(rows: Sequence[Row]) -> str:
    """Say what sensors measured the targets of the main group together; empty where one did, or it is not told."""
    grid = main_group(rows)[0].results[0].grid
    if grid is None or len(grid.target) < 2:
        return ""
    *others, last = grid.target
    return (
        f"Targets are what {', '.join(others)} and {last} have measured together by the times of {grid.target[0]}, "
        "whichever of them a row has for its inputs."
    )


def _named(rows: Sequence[Row]) -> str:
    """Name the first rows, and count the others."""
    more = f" and {len(rows) - _MOST_NAMES} more" if len(rows) > _MOST_NAMES else ""
    return ", ".join(row.name for row in rows[:_MOST_NAMES]) + more


def _by_targets(rows: Sequence[Row]) -> tuple[Row, list[Row], list[list[Row]]]:
    """Return a row of the main group, the rows with its targets, and the others by theirs."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.targets, []).append(row)
    main = main_group(rows)[0]
    return main, groups.pop(main.targets), list(groups.values())


def _what_differs(row: Row, with_main: Sequence[Row]) -> tuple[Row, list[str]]:
    """Find the row that another one is closest to, and say what makes the targets of the two others."""
    base = min(with_main, key=lambda other: len(changed_settings(settings_of(other), settings_of(row))))
    return base, changed_targets(settings_of(base), settings_of(row)) or ["the logs or their frames"]


def _other_targets(group: Sequence[Row], with_main: Sequence[Row]) -> Line:
    """Say what makes the targets of a group of rows others than those of the row that they are closest to."""
    row = group[0]
    base, reasons = _what_differs(row, with_main)
    shared = shared_windows(row, base)
    cells = (
        Cell(f"{'; '.join(reasons)} (against {base.name})"),
        Cell(f"{row.windows:,}", row.windows, f"{shared:,} shared"),
        _known_cell(row, base),
    )
    return Line(", ".join(each.name for each in group), cells)


def _known_cell(row: Row, base: Row) -> Cell:
    """Show how much of a target is known on average, and how much more or less that is than another row has."""
    area_m2, of_base_m2 = known_m2(row), known_m2(base)
    if not np.isfinite(area_m2):
        return Cell(ABSENT)
    note = f"{area_m2 / of_base_m2:.1%} of {base.name}'s" if of_base_m2 > 0 else ""
    return Cell(f"{area_m2:,.0f} m\N{SUPERSCRIPT TWO}", area_m2, note)


def known_m2(row: Row) -> float:
    """Return the mean area that is known in a target in square metres, NaN where the size of cells is not told."""
    grid = row.results[0].grid
    if grid is None:
        return np.nan
    cells = row.results[0].counts[:, list(row.classes.known)].sum(axis=(1, 2)).mean()
    return float(cells * grid.spec.cell_m**2)
