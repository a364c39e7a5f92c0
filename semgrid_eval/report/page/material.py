"""What a report is written from: scores, estimates, tables and figures, all worked out."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field

from semgrid_eval.classes import ClassSet
from semgrid_eval.report.claims.claims import on_cityscapes
from semgrid_eval.report.claims.findings import Finding, find
from semgrid_eval.report.estimates.bootstrap import (
    Everything,
    Resampling,
    Scores,
    classes_of,
    everywhere,
    score_all,
    score_regions,
    shared_iou,
)
from semgrid_eval.report.estimates.division import of_cells
from semgrid_eval.report.estimates.leads import best_leads, lead_series
from semgrid_eval.report.estimates.paces import divisions
from semgrid_eval.report.estimates.streams import WARM, Strategy, strategies
from semgrid_eval.report.estimates.way import against_expected, order_of
from semgrid_eval.report.figures import categories, curves, settings
from semgrid_eval.report.figures.distance import distance_plots
from semgrid_eval.report.figures.streams import stream_plots
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.rows.load import Row, Run
from semgrid_eval.report.rows.pairing import main_group
from semgrid_eval.report.rows.words import same_rows
from semgrid_eval.report.tables.scores import division_tables, score_tables
from semgrid_eval.report.tables.streams import lead_table, stream_table, wins_table
from semgrid_eval.report.tables.table import Table
from semgrid_eval.report.tables.truth import expected_table, order_sentence, way_table
from semgrid_eval.scores.metrics.table import iou_of
from semgrid_eval.scores.regions.distance import DISTANCE
from semgrid_eval.scores.regions.table import PARTITIONS


@dataclass(frozen=True)
class Material:
    """All that a report is written from; tables and figures by section of the page."""

    runs: Sequence[Run]
    resampling: Resampling
    everything: Everything
    scores: Scores  # the IoU of all cells, of the rows that stand in the tables of all rows
    findings: Sequence[Finding]
    tables: Mapping[str, Table | None]  # of the IoU of all cells
    parts: Mapping[str, Sequence[Table]]  # of every metric, by division
    figures: Mapping[str, Sequence[Plot]]
    expected: Everything  # IoU against what is measured on average, of the rows that are scored so
    order: str  # whether the order of rows is another one there, in a sentence
    same: Mapping[str, str]  # rows that are left out of tables and figures, since they are another one by another name
    streams: Sequence[Strategy] = ()
    best_leads: Mapping[str, float] = field(default_factory=dict)  # in ms by category

    @property
    def classes(self) -> ClassSet:
        """The classes of all rows."""
        return shared_iou(self.scores.values()).classes


def gather(runs: Sequence[Run], resampling: Resampling) -> Material:
    """Work out everything that a report shows."""
    rows, parts = [row for each in runs for row in each.rows], divisions(runs)
    whole = score_all(rows, parts, resampling)
    findings = find(runs, everywhere(whole, "iou"), whole["iou"]["actors"])
    same = same_rows(rows)
    rows, everything = [row for row in rows if row.name not in same], without(whole, same)
    streams, moving = strategies(everywhere(everything, "iou")), everything["iou"]["actors"].get("moving", {})
    everything = without(everything, delayed(streams))
    scores = everywhere(everything, "iou")
    tables = score_tables(scores, [each.tag for each in runs], {each.folder for each in runs if on_cityscapes(each)})
    figures = {
        "categories": categories.category_plots(scores),
        "distance": distance_plots(everything["iou"][DISTANCE.name], rows),
        "horizon": categories.horizon_plots(scores),
        "training": curves.training_plots(rows),
        "calibration": curves.calibration_plots(everywhere(everything, "calibration")),
        "settings": settings.settings_plots(scores),
        "streams": stream_plots(streams, moving),
    }
    warm = everything["iou"]["warm_up"].get(WARM, {})
    leads = lead_series(scores)
    tables |= {"streams": stream_table(streams, warm, moving), "stream_wins": wins_table(streams)}
    tables |= {"stream_leads": lead_table(leads)}
    tables |= {"way": way_table(scores, everything["iou"]["actors"].get("moving", {}), rows), "expected": None}
    expected, order = score_expected([row for each in runs for row in each.rows], resampling), ""
    if scored := everywhere(without(expected, same), "iou"):
        found = order_of(scores, scored, main_group([entry.row for entry in scored.values()])[0].targets)
        tables["expected"], order = expected_table(scored, found), order_sentence(scores, scored, found)
    in_parts = division_tables(everything, parts)
    return Material(
        runs,
        resampling,
        whole,
        scores,
        findings,
        tables,
        in_parts,
        figures,
        expected,
        order,
        same,
        tuple(streams),
        best_leads(leads),
    )


def delayed(streams: Sequence[Strategy]) -> set[str]:
    """Name the rows that differ from others in their latency alone: they have a section of their own."""
    return {entry.row.name for each in streams for entry in each.entries if entry is not each.measured}


def without(everything: Everything, hidden: Container[str]) -> Everything:
    """Leave out rows."""
    return {
        metric: {
            division: {
                region: {name: entry for name, entry in scores.items() if name not in hidden}
                for region, scores in parts.items()
            }
            for division, parts in divisions.items()
        }
        for metric, divisions in everything.items()
    }


def score_expected(rows: Sequence[Row], resampling: Resampling) -> Everything:
    """Score rows against what is measured on average, of all cells and near actors."""
    parts = [of_cells(PARTITIONS[name]) for name in ("all", "actors")]
    iou = iou_of(classes_of(rows))
    return {"iou": {part.name: score_regions(against_expected(rows), iou, part, resampling) for part in parts}}
