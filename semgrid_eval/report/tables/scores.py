"""The page's tables: scores, confusions and costs, and what each row changes."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from semgrid_eval.classes import known_name
from semgrid_eval.report.estimates.bootstrap import Everything, Parts, RowScores, Scores, everywhere, shared_iou
from semgrid_eval.report.estimates.division import EVERYWHERE, Division
from semgrid_eval.report.rows.load import Row, comparable
from semgrid_eval.report.rows.pairing import (
    HEADLINE,
    changed_settings,
    settings_of,
)
from semgrid_eval.report.tables.disturbances import disturbance_table
from semgrid_eval.report.tables.numbers import ABSENT, MINUS, interval_phrase, number
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, plain_table
from semgrid_eval.report.tables.targets import not_compared_table
from semgrid_eval.report.tables.values import difference_table, run_differences, side_by_side, value_table
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.scores.metrics.metric import Metric, divided
from semgrid_eval.scores.metrics.table import IOU, metrics_of
from semgrid_eval.words import plural

_PAPER = (
    " The paper's values (Table A1) come from Cityscapes' validation set; "
    "differences to them are marked where the row's interval excludes them."
)
_CATEGORIES = "Category scores: mean of the class IoUs, with 95% interval. Best of each column in bold."
_CLASSES = "Class IoU with 95% interval."
_MERGED = "Category scores after merging the classes of a category, as the Cityscapes benchmark does."
_VOID = " It leaves void out, as {} leaves out unknown."


def score_tables(scores: Scores, tags: Sequence[str], on_cityscapes: Collection[Path] = ()) -> dict[str, Table | None]:
    """Make the page's tables of IoU over all cells; one with nothing to show is None or has no lines.

    Args:
        scores: of the rows to show.
        tags: of the runs.
        on_cityscapes: the folders of the runs that can be set beside the paper's values.
    """
    in_runs = f"The same rows in several runs: differences to {tags[0] if tags else 'the first run'}."
    paper = _PAPER * bool(on_cityscapes)
    iou = shared_iou(scores.values())
    names, shown = iou.classes.names, (HEADLINE, *(name for name in iou.category_columns if name != HEADLINE))
    return {
        "categories": value_table("categories", _CATEGORIES + paper, scores, shown, on_cityscapes=on_cityscapes),
        "differences": difference_table("differences", _to_baseline("category"), scores, iou.compared),
        "class_differences": difference_table("class-differences", _to_baseline("class"), scores, names),
        "classes": value_table("classes", _CLASSES + paper, scores, names, on_cityscapes=on_cityscapes),
        "changes": changes_table(scores),
        "disturbances": disturbance_table(scores),
        "not_compared": not_compared_table(scores),
        "merged": value_table("merged", _MERGED + _void(iou), scores, iou.merged_columns),
        "runs": run_differences("runs", in_runs, scores, iou.compared),
        "costs": cost_table(list(scores.values())),
    }


def _void(iou: Iou) -> str:
    """Say which figure leaves `unknown` out, where that is in a category."""
    left_out = (f"merged_{known_name(name)}" for name in iou.classes.category_names)
    return "".join(_VOID.format(iou.labels[name]) for name in left_out if name in iou.labels)


def confusion_table(entry: RowScores, name: str) -> Table:
    """Show how the target's classes are predicted: shares of each target class, pooled over windows and seeds."""
    counts = entry.totals.sum(axis=0)
    shares = divided(counts, np.broadcast_to(counts.sum(axis=1, keepdims=True), counts.shape))
    iou = shared_iou([entry])
    labels = [iou.labels[name] for name in iou.classes.names]
    lines = []
    for target, of_target, counted in zip(labels, shares.tolist(), counts.tolist(), strict=True):
        cells = [_share_cell(*each, target) for each in zip(of_target, counted, labels, strict=True)]
        lines.append(Line(target, tuple(cells), rows=(entry.row.number,)))
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
        lines.append(Line(entry.row.name, cells, rows=(entry.row.number,)))
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
    scores = everywhere(everything, IOU.name).values()
    rows, metrics = [entry.row for entry in scores], metrics_of(shared_iou(scores).classes)
    return {
        division.name: [
            table
            for metric in metrics.values()
            if not (metric.name == IOU.name and division.name == EVERYWHERE.name)  # which has tables of its own
            for table in _tables(metric, division, everything[metric.name][division.name], rows)
        ]
        for division in divisions
    }


def _tables(metric: Metric, division: Division, parts: Parts, rows: Sequence[Row]) -> list[Table]:
    columns = division.shown(metric)
    if not columns or not parts:
        return []
    name = division.name if metric.name == IOU.name else f"{division.name}-{metric.name}"
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
    iou = shared_iou(entries)
    for at, entry in enumerate(entries):
        base = _closest(entry, entries[:at])
        changed = changed_settings(settings_of(base.row), settings_of(entry.row)).values() if base else ()
        if base is None or not changed:
            continue
        cells = (Cell("; ".join(changed)), *(_change(entry, base, column) for column in iou.compared))
        sign = MINUS if comparable(entry.row, base.row) else "beside"
        lines.append(Line(f"{entry.row.name} {sign} {base.row.name}", cells, rows=(entry.row.number,)))
    caption = (
        "What each row changes against the row above it that has the same model and the fewest other settings, "
        "and the difference of their scores. Where the targets are others, both scores are shown instead."
    )
    columns = ["Settings", *(iou.labels[column] for column in iou.compared)]
    return plain_table("changes", caption, "Rows", columns, lines) if lines else None


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
