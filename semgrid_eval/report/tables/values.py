"""Tables of scores: rows beside each other with the best marked, and differences to their baselines."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from semgrid_eval.report.claims.claims import paper_table
from semgrid_eval.report.estimates.bootstrap import RowScores, Scores
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import reference_of, verdict
from semgrid_eval.report.tables.numbers import ABSENT, MINUS, finite, interval_phrase, number, signed
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, value_cell
from semgrid_eval.scores.metrics.metric import column_of
from semgrid_eval.words import plural

_OTHER_TARGETS = " Rows whose targets differ (frames, grids, mask mode or split) are not compared with each other."


def value_table(
    name: str, caption: str, scores: Scores, columns: Sequence[str], *, on_cityscapes: Container[Path] = ()
) -> Table:
    """Show the columns of every row, the best of each marked; in runs on Cityscapes beside the paper's values."""
    best = {column: best_rows(scores, column) for column in columns}
    bodies = tuple(_value_body(entry, best, beside_paper=entry.row.run in on_cityscapes) for entry in scores.values())
    several = len({entry.row.targets for entry in scores.values()}) > 1
    return Table(name, caption + _OTHER_TARGETS * several, "Row", _headers(scores, columns), bodies)


def difference_table(
    name: str, caption: str, scores: Scores, columns: Sequence[str], rows: Sequence[Row] = ()
) -> Table | None:
    """Show each row's paired difference to its baseline, one of `rows`; None where no row has one."""
    pairs = ((entry, reference_scores(entry, scores, rows)) for entry in scores.values())
    return _differences(name, caption, [(entry, other) for entry, other in pairs if other], columns)


def run_differences(name: str, caption: str, scores: Scores, columns: Sequence[str]) -> Table | None:
    """Show, for the same row in several runs, the difference of each later one to the first on the same targets.

    Rows of one name are the same if they also have the same model and are asked the same.
    """
    first: dict[str, RowScores] = {}
    pairs = []
    for entry in scores.values():
        same = (entry.row.record.name, entry.row.record.facts, entry.row.targets)
        pairs.append((entry, first.setdefault(repr(same), entry)))
    return _differences(name, caption, [(entry, other) for entry, other in pairs if entry is not other], columns)


def reference_scores(entry: RowScores, scores: Scores, rows: Sequence[Row] = ()) -> RowScores | None:
    """Find the scores of the baseline that a row is measured against, None where it has none on the same cells.

    It is the same in all regions where it is chosen from all `rows`, and not from those alone that have scores here.
    """
    reference = reference_of(entry.row, rows or [other.row for other in scores.values()])
    other = None if reference is None else scores.get(reference.name)
    return other if other is not None and other.cells_key == entry.cells_key else None


def best_rows(scores: Scores, column: str) -> set[str]:
    """Name the rows that are the best of those on the same cells; none is where it stands alone among others.

    Rows that are told of the truth, or of when answers will be used, do not compete.
    """
    groups: dict[object, dict[str, float]] = {}
    for name, entry in scores.items():
        if entry.row.uses_truth or entry.row.is_oracle:
            continue
        sign = {"higher": 1.0, "lower": -1.0, "": np.nan}[column_of(entry.metric, column).better]
        groups.setdefault(entry.cells_key, {})[name] = entry.mean[column] * sign
    best: set[str] = set()
    for values in groups.values():
        top = max(filter(np.isfinite, values.values()), default=None)
        if len(values) > 1 or len(groups) == 1:
            best |= {name for name, value in values.items() if value == top}
    return best


def evidence(entry: RowScores, column: str) -> str:
    """Say what stands behind a number, for its tooltip."""
    value = f"{entry.row.name}, {column_of(entry.metric, column).label}: {number(entry.mean[column])}"
    behind = (plural(entry.cells[column], "cell"), plural(entry.windows, "window"), seeds(entry))
    return "; ".join((value, *behind, interval_phrase(entry.estimate(column))))


def seeds(entry: RowScores) -> str:
    """Count the seeds behind a row."""
    return plural(len(entry.results), "seed") if entry.results[0].record.seed is not None else "no training seed"


def short_count(count: int) -> str:
    """Write a count with three digits."""
    if count < 10**4:
        return f"{count:,}"
    return f"{count / 10**6:.3g} M" if count >= 10**6 else f"{count / 10**3:.3g} k"


def _value_body(entry: RowScores, best: Mapping[str, set[str]], *, beside_paper: bool) -> tuple[Line, ...]:
    values = tuple(
        value_cell(entry.estimate(name), title=evidence(entry, name), best=entry.row.name in rows)
        for name, rows in best.items()
    )
    name = entry.row.name
    lines = [Line(name, values, "truth" if entry.row.uses_truth else "", entry.row.record.label, (entry.row.number,))]
    paper = paper_table().get(entry.row.record.name, {}) if beside_paper else {}
    if set(best) <= set(paper):
        source = f"the paper's {entry.row.record.name}, Table A1: mean over 20 seeds, Cityscapes"
        lines.append(
            Line("paper", tuple(Cell(number(paper[n]), finite(paper[n]), title=source) for n in best), "paper")
        )
        lines.append(Line("difference", tuple(_paper_gap(entry, name, paper[name]) for name in best), "paper"))
    return tuple(lines)


def _paper_gap(entry: RowScores, column: str, paper: float) -> Cell:
    """Show the difference to the paper's value, of which no interval is known: the row's own, moved by it."""
    mine = entry.estimate(column)
    gap = Estimate(mine.value - paper, mine.low - paper, mine.high - paper)
    title = f"{evidence(entry, column)}; less the paper's {number(paper)}: {interval_phrase(gap, with_sign=True)}"
    return Cell(signed(gap.value), finite(gap.value), title=title, tone=verdict(gap))


def _differences(
    name: str, caption: str, pairs: Sequence[tuple[RowScores, RowScores]], columns: Sequence[str]
) -> Table | None:
    bodies = tuple((_difference_line(entry, other, columns),) for entry, other in pairs)
    headers = _headers({entry.row.name: entry for entry, _ in pairs}, columns)
    return Table(name, caption, "Rows", headers, bodies) if bodies else None


def _difference_line(entry: RowScores, other: RowScores, columns: Sequence[str]) -> Line:
    cells = tuple(_difference(entry, other, column) for column in columns)
    return Line(f"{entry.row.name} {MINUS} {other.row.name}", cells, rows=(entry.row.number,))


def _difference(entry: RowScores, other: RowScores, column: str) -> Cell:
    difference = entry.minus(other, column)
    title = f"{evidence(entry, column)}; difference: {interval_phrase(difference, with_sign=True)}"
    return difference_cell(difference, title=title, better=column_of(entry.metric, column).better)


def _headers(scores: Scores, columns: Sequence[str]) -> tuple[tuple[str, str], ...]:
    first = list(scores.values())[:1]
    return tuple((column_of(e.metric, c).label, f"{short_count(e.cells[c])} cells") for e in first for c in columns)


def side_by_side(tables: Mapping[str, Table | None]) -> Table | None:
    """Join regions' tables of the same columns by the headers of their lines, a dash where one of them lacks a line."""
    parts = {part: table for part, table in tables.items() if table}
    if not parts:
        return None
    columns = tuple((label, f"{part}, {note}") for part, table in parts.items() for label, note in table.columns)
    lines = {part: {body[0].header: body[0] for body in table.bodies} for part, table in parts.items()}
    first = next(iter(parts.values()))
    absent = Line("", (Cell(ABSENT),) * len(first.columns))
    rows = {header: line.rows for found in lines.values() for header, line in found.items()}
    bodies = tuple(
        (Line(header, tuple(c for found in lines.values() for c in found.get(header, absent).cells), rows=about),)
        for header, about in rows.items()
    )
    return replace(first, columns=columns, bodies=bodies)
