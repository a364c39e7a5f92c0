"""The page's tables of scores: of all cells, of every metric in every division, of confusions, and of costs."""

from collections.abc import Sequence

import numpy as np

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.report.estimates.bootstrap import LABELS, Everything, Parts, RowScores, Scores
from semgrid_eval.report.estimates.division import EVERYWHERE, Division
from semgrid_eval.report.rows.load import Result
from semgrid_eval.report.rows.pairing import DIFFERENCE_COLUMNS
from semgrid_eval.report.tables.changes import changes_table, not_compared_table
from semgrid_eval.report.tables.table import ABSENT, Cell, Line, Table, plain_cell, plain_table, plural
from semgrid_eval.report.tables.values import difference_table, run_differences, seeds, side_by_side, value_table
from semgrid_eval.scores.metrics.iou import CATEGORY_COLUMNS, MERGED_COLUMNS
from semgrid_eval.scores.metrics.metric import Floats, Metric, divided
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
    first = tags[0] if tags else "the first run"
    return {
        "categories": value_table("categories", _CATEGORIES, scores, CATEGORY_COLUMNS, beside_paper=True),
        "differences": difference_table("differences", _to_baseline("category"), scores, DIFFERENCE_COLUMNS),
        "class_differences": difference_table("class-differences", _to_baseline("class"), scores, CLASS_NAMES),
        "classes": value_table("classes", _CLASSES, scores, CLASS_NAMES, beside_paper=True),
        "changes": changes_table(scores),
        "not_compared": not_compared_table(scores),
        "merged": value_table("merged", _MERGED, scores, MERGED_COLUMNS),
        "windows": window_means(scores),
        "runs": run_differences(
            "runs", f"The same rows in several runs: differences to {first}.", scores, DIFFERENCE_COLUMNS
        ),
        "costs": cost_table(list(scores.values())),
    }


def window_means(scores: Scores) -> Table:
    """Show the mean over windows of each window's own scores, where the other tables pool their counts."""
    lines = [Line(name, _window_cells(entry)) for name, entry in scores.items()]
    caption = "Mean over windows of each window's own category scores; windows without a category are left out."
    return plain_table("windows", caption, "Row", [LABELS[column] for column in CATEGORY_COLUMNS], lines)


def _window_cells(entry: RowScores) -> tuple[Cell, ...]:
    at = [list(LABELS).index(column) for column in CATEGORY_COLUMNS]
    total, number = np.zeros((2, len(at)))
    for result in entry.results:
        values = _window_figures(entry.metric, result)[:, at]
        total, number = total + np.nansum(values, axis=0), number + np.isfinite(values).sum(axis=0)
    texts = [f"{entry.row.name}: {plural(int(n), 'window score')}, all seeds together; {seeds(entry)}" for n in number]
    means = divided(total, number.astype(np.int64)).tolist()
    return tuple(plain_cell(mean, title=text) for mean, text in zip(means, texts, strict=True))


def _window_figures(metric: Metric, result: Result) -> Floats:
    """Return the figures (N, Q) of each window alone, without keeping what they come from."""
    counts = result.read(metric.name, "all")
    assert counts is not None  # all cells are always counted
    return metric.figures(metric.ratios(counts[:, 0].astype(np.int64)))


def confusion_table(entry: RowScores, name: str) -> Table:
    """Show how the target's classes are predicted: shares of each target class, pooled over windows and seeds."""
    counts = entry.totals.sum(axis=0)
    shares = divided(counts, np.broadcast_to(counts.sum(axis=1, keepdims=True), counts.shape))
    labels = [LABELS[name] for name in CLASS_NAMES]
    lines = []
    for target, of_target, number in zip(labels, shares.tolist(), counts.tolist(), strict=True):
        cells = [_share_cell(*each, target) for each in zip(of_target, number, labels, strict=True)]
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
    return {
        division.name: [
            table
            for metric in METRICS.values()
            if not (metric is IOU and division.name == EVERYWHERE.name)  # which has tables of its own
            for table in _tables(metric, division, everything[metric.name][division.name])
        ]
        for division in divisions
    }


def _tables(metric: Metric, division: Division, parts: Parts) -> list[Table]:
    columns = division.columns(metric)
    if not columns or not parts:
        return []
    name = division.name if metric is IOU else f"{division.name}-{metric.name}"
    what = f"{metric.title} {division.words}".rstrip()
    values = f"{what}, with 95% interval. Best of each in bold."
    differences = f"{what}: differences to the baseline, resampled together. Marked where the interval excludes zero."
    shown = {part: value_table(name, values, scores, columns) for part, scores in parts.items()}
    gaps = {p: difference_table(f"{name}-differences", differences, each, columns) for p, each in parts.items()}
    alone = len(division.regions) == 1
    tables = (next(iter(each.values())) if alone else side_by_side(each) for each in (shown, gaps))
    return [table for table in tables if table is not None]
