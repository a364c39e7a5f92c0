"""The page's tables: categories, differences to the baselines, classes beside the paper, and other countings."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_NAMES, KNOWN_IDS
from semgrid_eval.report.claims.paper import paper_table
from semgrid_eval.report.estimates.bootstrap import (
    CATEGORY_COLUMNS,
    COLUMNS,
    LABELS,
    MERGED_COLUMNS,
    Estimate,
    RowScores,
    Scores,
    score_columns,
)
from semgrid_eval.report.rows.pairing import comparable, reference_of, verdict
from semgrid_eval.report.tables.long import target_cells
from semgrid_eval.report.tables.table import (
    ABSENT,
    Cell,
    Line,
    Table,
    difference_cell,
    interval_phrase,
    number,
    plain_cell,
    plural,
    signed,
    value_cell,
)
from semgrid_eval.report.tables.where import BANDS, ORIGINS, Where
from semgrid_eval.scores.iou import mean_finite

_PAPER = (
    "The paper's values (Table A1) come from Cityscapes' validation set; "
    "differences to them are marked where the row's interval excludes them."
)


def value_table(name: str, caption: str, scores: Scores, columns: Sequence[str], *, beside_paper: bool = True) -> Table:
    """Show the columns of every row, with the best marked, beside the paper's values where it has them."""
    bodies = tuple(
        _value_body(entry, {column: _best(entry, scores, column) for column in columns}, beside_paper=beside_paper)
        for entry in scores.values()
    )
    return Table(name, caption, "Row", _headers(scores, columns), bodies)


def category_values(scores: Scores) -> Table:
    """Show the categories as the paper counts them."""
    caption = (
        "Category scores: mean of the class IoUs, with 95% interval. Best among rows with the same targets in bold. "
        + _PAPER
    )
    return value_table("categories", caption, scores, CATEGORY_COLUMNS)


def merged_values(scores: Scores) -> Table:
    """Show the categories with their classes merged before counting."""
    caption = (
        "Category scores after merging the classes of a category, as the Cityscapes benchmark does. "
        "It leaves void out, as Static (known, merged) leaves out unknown."
    )
    return value_table("merged", caption, scores, MERGED_COLUMNS)


def window_means(scores: Scores) -> Table:
    """Show the mean over windows of each window's own scores, where the other tables pool their counts."""
    rows = []
    for name, entry in scores.items():
        columns = [score_columns(result.counts.astype(np.int64)) for result in entry.row.results]
        values = np.concatenate(columns)[:, [COLUMNS.index(column) for column in CATEGORY_COLUMNS]]
        counts = np.isfinite(values).sum(axis=0)
        behind = [f"{name}: {plural(int(n), 'window score')}, all seeds together; {_seeds(entry)}" for n in counts]
        rows.append((name, mean_finite(values, axis=0), behind))
    caption = "Mean over windows of each window's own category scores; windows without a category are left out."
    return _plain_table("windows", caption, [LABELS[column] for column in CATEGORY_COLUMNS], rows)


def difference_table(name: str, scores: Scores, columns: Sequence[str]) -> Table | None:
    """Show each row's paired difference to its baseline; None where no row has one."""
    rows, bodies = [entry.row for entry in scores.values()], []
    for entry in scores.values():
        reference = reference_of(entry.row, rows)
        if reference is None:
            continue
        bodies.append((_difference_line(entry, scores[reference.name], columns),))
    kind = "by class" if set(columns) <= set(CLASS_NAMES) else "by category"
    caption = f"Differences to the baseline {kind}, resampled together. Marked where the interval excludes zero."
    return Table(name, caption, "Rows", _headers(scores, columns), tuple(bodies)) if bodies else None


def class_values(scores: Scores) -> Table:
    """Show the classes of every row beside the paper's values and the difference to them."""
    return value_table("classes", f"Class IoU with 95% interval. {_PAPER}", scores, CLASS_NAMES)


def run_differences(scores: Scores, tags: Sequence[str], columns: Sequence[str]) -> Table | None:
    """Show, for rows of one name and the same targets in several runs, the difference of later runs to the first."""
    groups: dict[str, list[RowScores]] = {}
    for entry in scores.values():
        groups.setdefault(entry.row.record.name, []).append(entry)
    bodies = []
    for group in groups.values():
        bodies += [
            (_difference_line(entry, group[0], columns),) for entry in group[1:] if comparable(entry.row, group[0].row)
        ]
    caption = f"The same rows in several runs: differences to {tags[0] if tags else 'the first run'}."
    return Table("runs", caption, "Rows", _headers(scores, columns), tuple(bodies)) if bodies else None


def _value_body(entry: RowScores, best: Mapping[str, float], *, beside_paper: bool) -> tuple[Line, ...]:
    values = tuple(
        value_cell(entry.estimate(name), title=_evidence(entry, name), best=entry.mean[name] == best[name])
        for name in best
    )
    lines = [Line(entry.row.name, values, title=entry.row.record.label)]
    paper = paper_table().get(entry.row.record.name, {}) if beside_paper else {}
    if set(best) <= set(paper):
        source = f"the paper's {entry.row.record.name}, Table A1: mean over 20 seeds, Cityscapes"
        lines.append(Line("paper", tuple(plain_cell(paper[name], title=source) for name in best), "paper"))
        gaps = tuple(_paper_gap(entry, name, paper[name]) for name in best)
        lines.append(Line("difference", gaps, "paper"))
    return tuple(lines)


def _paper_gap(entry: RowScores, column: str, paper: float) -> Cell:
    """Show the difference to the paper's value, of which no interval is known: the row's own, moved by it."""
    mine = entry.estimate(column)
    gap = Estimate(mine.value - paper, mine.low - paper, mine.high - paper)
    title = f"{_evidence(entry, column)}; less the paper's {number(paper)}: {_interval_text(gap)}"
    return Cell(signed(gap.value), gap.value if np.isfinite(gap.value) else None, title=title, tone=verdict(gap))


def _difference_line(entry: RowScores, other: RowScores, columns: Sequence[str]) -> Line:
    differences = [(column, entry.minus(other, column)) for column in columns]
    cells = tuple(
        difference_cell(d, title=f"{_evidence(entry, c)}; difference: {_interval_text(d)}") for c, d in differences
    )
    return Line(f"{entry.row.name} \N{MINUS SIGN} {other.row.name}", cells)


def _headers(scores: Scores, columns: Sequence[str]) -> tuple[tuple[str, str], ...]:
    first = next(iter(scores.values()), None)
    cells = {} if first is None else target_cells(first.row.results[0].counts)
    return tuple((LABELS[column], f"{_short_count(cells.get(column, 0))} cells") for column in columns)


def _short_count(count: int) -> str:
    for unit, size in (("M", 10**6), ("k", 10**4)):
        if count >= size:
            return f"{count / (10**6 if unit == 'M' else 10**3):.3g} {unit}"
    return f"{count:,}"


def _best(row: RowScores, scores: Scores, column: str) -> float:
    """Return the best value among the rows that can be compared with one, NaN where there is no other."""
    values = [entry.mean[column] for entry in scores.values() if comparable(row.row, entry.row)]
    return max((value for value in values if np.isfinite(value)), default=np.nan) if len(values) > 1 else np.nan


def _evidence(entry: RowScores, column: str) -> str:
    """Say what stands behind a number, for its tooltip."""
    row = entry.row
    cells = target_cells(row.results[0].counts)[column]
    parts = [
        f"{row.name}, {LABELS[column]}: {number(entry.mean[column])}",
        plural(cells, "target cell"),
        plural(row.windows, "window"),
        _seeds(entry),
        interval_phrase(entry.estimate(column)),
    ]
    return "; ".join(parts)


def _seeds(entry: RowScores) -> str:
    results = entry.row.results
    return plural(len(results), "seed") if results[0].record.seed is not None else "no chance involved"


def _interval_text(difference: Estimate) -> str:
    return interval_phrase(difference, with_sign=True)


def where_tables(found: Sequence[Where]) -> dict[str, Table | None]:
    """Show scores by distance and by what the inputs had seen of a cell."""
    if not found:
        return {"distance": None, "origin": None}
    distance = "Mean class IoU without unknown by distance from the vehicle (first repeat)."
    origin = "Share of the target's known cells that are predicted right, by where the inputs had seen something there."
    bands = [(e.row.name, e.band_scores(), _cell_titles(e, axis=0)) for e in found]
    origins = [(e.row.name, e.origin_shares(), _cell_titles(e, axis=1)) for e in found]
    return {
        "distance": _plain_table("distance", distance, BANDS, bands),
        "origin": _plain_table("origin", origin, ORIGINS, origins),
    }


def _cell_titles(entry: Where, *, axis: int) -> list[str]:
    """Count the target's known cells in each band of distance (axis 0) or origin (axis 1), for tooltips."""
    known = entry.cells[..., KNOWN_IDS, :]
    counts = np.moveaxis(known, axis, 0).reshape(known.shape[axis], -1).sum(axis=1)
    shown = f"{plural(entry.row.windows, 'window')}; first repeat; no interval"
    return [f"{entry.row.name}: {plural(int(count), 'known target cell')}; {shown}" for count in counts]


def confusion_table(entry: RowScores, name: str) -> Table:
    """Show how the target's classes are predicted: shares of each target class, pooled over windows and seeds."""
    counts = sum(result.counts.sum(axis=0, dtype=np.int64) for result in entry.row.results)
    total = np.asarray(counts).sum(axis=1, keepdims=True)
    shares = np.divide(counts, total, out=np.full((len(CLASS_NAMES),) * 2, np.nan), where=total > 0)
    bodies = tuple(
        (
            Line(
                LABELS[target],
                tuple(
                    _share_cell(value, int(count), target, other)
                    for other, value, count in zip(CLASS_NAMES, line, numbers, strict=True)
                ),
            ),
        )
        for target, line, numbers in zip(CLASS_NAMES, shares, np.asarray(counts), strict=True)
    )
    caption = f"{entry.row.name}: how each class of the target (line) is predicted (column), in percent of its cells."
    return Table(name, caption, "Target", tuple((LABELS[c], "") for c in CLASS_NAMES), bodies)


def _share_cell(value: float, count: int, target: str, other: str) -> Cell:
    if not np.isfinite(value):
        return Cell(ABSENT)
    title = f"{plural(count, 'cell')}, {value:.2%} of {LABELS[target]}, over all windows and seeds: {LABELS[other]}"
    return Cell(f"{100 * value:.1f}", value, title=title, tone="heat")


def _plain_table(
    name: str, caption: str, columns: Sequence[str], rows: Sequence[tuple[str, NDArray[np.float64], list[str]]]
) -> Table:
    bodies = tuple(
        (Line(row, tuple(plain_cell(float(v), title=text) for v, text in zip(values, titles, strict=True))),)
        for row, values, titles in rows
    )
    return Table(name, caption, "Row", tuple((column, "") for column in columns), bodies)


def training_table(rows: Sequence[RowScores]) -> Table:
    """Show what each row cost: parameters, training and prediction time, device."""
    bodies = []
    for entry in rows:
        records = [result.record for result in entry.row.results]
        train = [record.train_seconds for record in records if record.train_seconds is not None]
        cells = (
            Cell(f"{records[0].parameters:,}" if records[0].parameters else "none", records[0].parameters or 0),
            Cell(str(len(records)), len(records)),
            _time_cell("s", train, 0),
            _time_cell("ms a window", entry.row.window_ms, 1),
            Cell(", ".join(sorted({record.device for record in records}))),
        )
        bodies.append((Line(entry.row.name, cells),))
    columns = tuple((text, "") for text in ("Parameters", "Results", "Training", "Prediction", "Device"))
    return Table("costs", "What each row cost; times are means over seeds.", "Row", columns, tuple(bodies))


def _time_cell(unit: str, times: Sequence[float], digits: int) -> Cell:
    """Show a mean time, with its range over seeds in the tooltip."""
    if not times:
        return Cell("none")
    mean = float(np.mean(times))
    title = f"mean of {plural(len(times), 'result')}; {min(times):,.{digits}f} to {max(times):,.{digits}f} {unit}"
    return Cell(f"{mean:,.{digits}f} {unit}", mean, title=title)
