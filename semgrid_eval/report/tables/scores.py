"""The page's tables: scores, confusions and costs, what each row changes, and what cannot be compared at all."""

from collections.abc import Sequence

import numpy as np

from semgrid_eval.classes import CLASS_NAMES, KNOWN_IDS
from semgrid_eval.report.estimates.bootstrap import LABELS, Everything, Parts, RowScores, Scores, everywhere
from semgrid_eval.report.estimates.division import EVERYWHERE, Division
from semgrid_eval.report.rows.load import Row, comparable
from semgrid_eval.report.rows.pairing import (
    DIFFERENCE_COLUMNS,
    changed_settings,
    changed_targets,
    main_group,
    settings_of,
    shared_windows,
)
from semgrid_eval.report.tables.disturbances import disturbance_table
from semgrid_eval.report.tables.numbers import ABSENT, MINUS, interval_phrase, number, plural
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, plain_table
from semgrid_eval.report.tables.values import difference_table, run_differences, side_by_side, value_table
from semgrid_eval.scores.metrics.iou import CATEGORY_COLUMNS, MERGED_COLUMNS
from semgrid_eval.scores.metrics.metric import Metric, divided
from semgrid_eval.scores.metrics.table import IOU, METRICS

_PAPER = (
    "The paper's values (Table A1) come from Cityscapes' validation set; "
    "differences to them are marked where the row's interval excludes them."
)
_CATEGORIES = f"Category scores: mean of the class IoUs, with 95% interval. Best of each column in bold. {_PAPER}"
_CLASSES = f"Class IoU with 95% interval. {_PAPER}"
_MERGED = (
    "Category scores after merging the classes of a category, as the Cityscapes benchmark does. "
    "It leaves void out, as Static (known, merged) leaves out unknown."
)


def score_tables(scores: Scores, tags: Sequence[str]) -> dict[str, Table | None]:
    """Make the page's tables of IoU over all cells; one with nothing to show is None or has no lines."""
    in_runs = f"The same rows in several runs: differences to {tags[0] if tags else 'the first run'}."
    return {
        "categories": value_table("categories", _CATEGORIES, scores, CATEGORY_COLUMNS, beside_paper=True),
        "differences": difference_table("differences", _to_baseline("category"), scores, DIFFERENCE_COLUMNS),
        "class_differences": difference_table("class-differences", _to_baseline("class"), scores, CLASS_NAMES),
        "classes": value_table("classes", _CLASSES, scores, CLASS_NAMES, beside_paper=True),
        "changes": changes_table(scores),
        "disturbances": disturbance_table(scores),
        "not_compared": not_compared_table(scores),
        "merged": value_table("merged", _MERGED, scores, MERGED_COLUMNS),
        "runs": run_differences("runs", in_runs, scores, DIFFERENCE_COLUMNS),
        "costs": cost_table(list(scores.values())),
    }


def confusion_table(entry: RowScores, name: str) -> Table:
    """Show how the target's classes are predicted: shares of each target class, pooled over windows and seeds."""
    counts = entry.totals.sum(axis=0)
    shares = divided(counts, np.broadcast_to(counts.sum(axis=1, keepdims=True), counts.shape))
    labels = [LABELS[name] for name in CLASS_NAMES]
    lines = []
    for target, of_target, counted in zip(labels, shares.tolist(), counts.tolist(), strict=True):
        cells = [_share_cell(*each, target) for each in zip(of_target, counted, labels, strict=True)]
        lines.append(Line(target, tuple(cells)))
    caption = f"{entry.row.name}: how each class of the target (line) is predicted (column), in percent of its cells."
    return plain_table(name, caption, "Target", labels, lines)


def _share_cell(share: float, count: int, other: str, target: str) -> Cell:
    if not np.isfinite(share):
        return Cell(ABSENT)
    title = f"{plural(count, 'cell')}, {share:.2%} of {target}, over all windows and seeds: {other}"
    return Cell(f"{100 * share:.1f}", share, title=title, tone="heat")


def cost_table(rows: Sequence[RowScores]) -> Table:
    """Show what each row cost: parameters, training and prediction time, device."""
    lines = []
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
        lines.append(Line(entry.row.name, cells))
    columns = ("Parameters", "Results", "Training", "Prediction", "Device")
    return plain_table("costs", "What each row cost; times are means over seeds.", "Row", columns, lines)


def _time_cell(unit: str, times: Sequence[float], digits: int) -> Cell:
    """Show a mean time, with its range over seeds in the tooltip."""
    if not times:
        return Cell("none")
    mean = float(np.mean(times))
    title = f"mean of {plural(len(times), 'result')}; {min(times):,.{digits}f} to {max(times):,.{digits}f} {unit}"
    return Cell(f"{mean:,.{digits}f} {unit}", mean, title=title)


def _to_baseline(kind: str) -> str:
    return f"Differences to the baseline by {kind}, resampled together. Marked where the interval excludes zero."


def division_tables(everything: Everything, divisions: Sequence[Division]) -> dict[str, list[Table]]:
    """Make the tables by division; one whose regions nobody knows has none."""
    rows = [entry.row for entry in everywhere(everything, IOU.name).values()]
    return {
        division.name: [
            table
            for metric in METRICS.values()
            if not (metric is IOU and division.name == EVERYWHERE.name)  # which has tables of its own
            for table in _tables(metric, division, everything[metric.name][division.name], rows)
        ]
        for division in divisions
    }


def _tables(metric: Metric, division: Division, parts: Parts, rows: Sequence[Row]) -> list[Table]:
    columns = division.columns(metric)
    if not columns or not parts:
        return []
    name = division.name if metric is IOU else f"{division.name}-{metric.name}"
    what = f"{metric.title} {division.words}".rstrip()
    others = " Rows with other inputs have other cells here and are not compared." if division.by_inputs else ""
    values = f"{what}, with 95% interval. Best of each in bold.{others}"
    differences = f"{what}: differences to the baseline, resampled together. Marked where the interval excludes zero."
    shown = {part: value_table(name, values, scores, columns) for part, scores in parts.items()}
    gaps = {p: difference_table(f"{name}-differences", differences, each, columns, rows) for p, each in parts.items()}
    alone = len(division.regions) == 1
    tables = (next(iter(each.values())) if alone else side_by_side(each) for each in (shown, gaps))
    return [table for table in tables if table is not None]


def changes_table(scores: Scores) -> Table | None:
    """Show what each row changes against the row of its model above it that it is closest to, and what that does."""
    entries, lines = list(scores.values()), []
    for at, entry in enumerate(entries):
        base = _closest(entry, entries[:at])
        changed = changed_settings(settings_of(base.row), settings_of(entry.row)).values() if base else ()
        if base is None or not changed:
            continue
        cells = (Cell("; ".join(changed)), *(_change(entry, base, column) for column in DIFFERENCE_COLUMNS))
        sign = MINUS if comparable(entry.row, base.row) else "beside"
        lines.append(Line(f"{entry.row.name} {sign} {base.row.name}", cells))
    caption = (
        "What each row changes against the row above it that has the same model and the fewest other settings, "
        "and the difference of their scores. Where the targets are others, both scores are shown instead."
    )
    columns = ["Settings", *(LABELS[column] for column in DIFFERENCE_COLUMNS)]
    return plain_table("changes", caption, "Rows", columns, lines) if lines else None


def not_compared_table(scores: Scores) -> Table | None:
    """List the rows whose targets are others than those of the main group, and what makes them so."""
    rows = [entry.row for entry in scores.values()]
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.targets, []).append(row)
    if len(groups) < 2:
        return None
    main = main_group(rows)[0]
    with_main = groups.pop(main.targets)
    caption = (
        f"Not compared with {main.name} and the rows that share its targets. Scores are subtracted only between "
        "rows with the same targets: the same frames of the same logs, grid, mask mode and split."
    )
    lines = [_other_targets(group, with_main) for group in groups.values()]
    columns = ("What differs", "Windows", "Known of a target")
    return plain_table("not-compared", caption, "Rows with the same targets", columns, lines)


def _other_targets(group: Sequence[Row], with_main: Sequence[Row]) -> Line:
    """Say what makes the targets of a group of rows others than those of the row that they are closest to."""
    row = group[0]
    base = min(with_main, key=lambda other: len(changed_settings(settings_of(other), settings_of(row))))
    reasons = changed_targets(settings_of(base), settings_of(row)) or ["the logs or their frames"]
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
    cells = row.results[0].counts[:, list(KNOWN_IDS)].sum(axis=(1, 2)).mean()
    return float(cells * grid.spec.cell_m**2)


def _closest(entry: RowScores, above: Sequence[RowScores]) -> RowScores | None:
    """Find the row of the same model and run with the fewest other settings, rather one with the same targets."""
    mine = entry.row

    def distance(other: RowScores) -> tuple[int, bool]:
        changed = changed_settings(settings_of(other.row), settings_of(mine))
        return len(changed), not comparable(mine, other.row)

    alike = (e for e in above if (e.row.record.facts.model, e.row.run) == (mine.record.facts.model, mine.run))
    return min(alike, key=distance, default=None)


def _change(entry: RowScores, base: RowScores, column: str) -> Cell:
    title = f"{plural(entry.row.windows, 'window')}; {plural(len(entry.row.results), 'result')}"
    if not comparable(entry.row, base.row):
        text = f"{number(entry.mean[column])}, {number(base.mean[column])}"
        return Cell(text, note="other targets", title=f"{title}; the targets differ, so there is no difference")
    difference = entry.minus(base, column)
    return difference_cell(difference, title=f"{title}; {interval_phrase(difference, with_sign=True)}")
