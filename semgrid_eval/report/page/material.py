"""What a report is written from: runs, every score, what it says of the claims, and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semgrid_eval.report.claims.findings import Finding, find
from semgrid_eval.report.estimates.bootstrap import Everything, Scores, everywhere, score_all
from semgrid_eval.report.estimates.resampling import Resampling
from semgrid_eval.report.estimates.table import divisions
from semgrid_eval.report.figures import bars, calibration, horizon, settings, training
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.rows.load import Run
from semgrid_eval.report.tables.scores import division_tables, score_tables
from semgrid_eval.report.tables.table import Table


@dataclass(frozen=True)
class Material:
    """All that a report is written from; tables and figures by section of the page."""

    runs: Sequence[Run]
    resampling: Resampling
    everything: Everything
    findings: Sequence[Finding]
    tables: Mapping[str, Table | None]  # of the IoU of all cells
    parts: Mapping[str, Sequence[Table]]  # of every metric, by division
    figures: Mapping[str, Sequence[Plot]]

    @property
    def scores(self) -> Scores:
        """The IoU of all cells."""
        return everywhere(self.everything, "iou")

    @property
    def all_tables(self) -> list[Table]:
        """The tables of scores that have something to show."""
        found = [*self.tables.values(), *(table for each in self.parts.values() for table in each)]
        return [table for table in found if table is not None and table.bodies]


def gather(runs: Sequence[Run], resampling: Resampling) -> Material:
    """Work out everything that a report shows."""
    rows, parts = [row for each in runs for row in each.rows], divisions(runs)
    everything = score_all(rows, parts, resampling)
    scores = everywhere(everything, "iou")
    findings = find(runs, scores, everything["iou"]["actors"])
    tables = score_tables(scores, [each.tag for each in runs])
    figures = {
        "categories": bars.category_plots(scores),
        "horizon": horizon.horizon_plots(scores),
        "training": training.training_plots(rows),
        "calibration": calibration.calibration_plots(everywhere(everything, "calibration")),
        "settings": settings.settings_plots(scores),
    }
    return Material(runs, resampling, everything, findings, tables, division_tables(everything, parts), figures)
