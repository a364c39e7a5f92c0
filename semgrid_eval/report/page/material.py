"""What a report is written from: runs, every score, what it says of the claims, and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semgrid_eval.report.claims.findings import Finding, find
from semgrid_eval.report.estimates.bootstrap import Everything, Parts, Scores, everywhere, score_all
from semgrid_eval.report.estimates.division import Division
from semgrid_eval.report.estimates.resampling import Resampling
from semgrid_eval.report.estimates.table import divisions
from semgrid_eval.report.figures import bars, calibration, horizon, settings, training
from semgrid_eval.report.figures.style import Plot
from semgrid_eval.report.rows.load import Row, Run


@dataclass(frozen=True)
class Material:
    """All that a report is written from.

    Args:
        runs: the runs as read from disk.
        divisions: what is scored apart: regions of cells, and kinds of windows.
        everything: scores by metric, division and region, of all rows that have some.
        resampling: how their intervals were made.
        findings: what the runs say about the paper's claims.
        figures: by section of the page.
    """

    runs: Sequence[Run]
    divisions: Sequence[Division]
    everything: Everything
    resampling: Resampling
    findings: Sequence[Finding]
    figures: Mapping[str, Sequence[Plot]]

    @property
    def scores(self) -> Scores:
        """The IoU of all cells."""
        return everywhere(self.everything, "iou")

    @property
    def parts(self) -> Mapping[str, Parts]:
        """The IoU by division and region: `parts["actors"]["moving"]`."""
        return self.everything["iou"]


def gather(runs: Sequence[Run], resampling: Resampling) -> Material:
    """Work out everything that a report shows."""
    rows = [row for each in runs for row in each.rows]
    parts = divisions(runs)
    everything = score_all(rows, parts, resampling)
    findings = find(runs, everywhere(everything, "iou"), everything["iou"]["actors"])
    return Material(runs, parts, everything, resampling, findings, draw_figures(everything, rows))


def draw_figures(everything: Everything, rows: Sequence[Row]) -> dict[str, list[Plot]]:
    """Draw all figures by section of the page."""
    scores = everywhere(everything, "iou")
    return {
        "categories": bars.category_plots(scores),
        "horizon": horizon.horizon_plots(scores),
        "training": training.training_plots(rows),
        "calibration": calibration.calibration_plots(everywhere(everything, "calibration")),
        "settings": settings.settings_plots(scores),
    }
