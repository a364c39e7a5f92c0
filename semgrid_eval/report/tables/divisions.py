"""The tables of every metric in every division: scores of regions side by side, and differences to the baselines."""

from collections.abc import Sequence

from semgrid_eval.report.estimates.bootstrap import Everything, Parts
from semgrid_eval.report.estimates.division import EVERYWHERE, Division
from semgrid_eval.report.tables.table import Table
from semgrid_eval.report.tables.values import difference_table, part_differences, part_values, value_table
from semgrid_eval.scores.metrics.metric import Metric
from semgrid_eval.scores.metrics.table import IOU, METRICS


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
    if len(division.regions) == 1:
        (scores,) = parts.values()
        shown = value_table(name, values, scores, columns)
        gaps = difference_table(f"{name}-differences", differences, scores, columns)
    else:
        shown = part_values(name, values, parts, columns)
        gaps = part_differences(f"{name}-differences", differences, parts, columns)
    return [table for table in (shown, gaps) if table is not None]
