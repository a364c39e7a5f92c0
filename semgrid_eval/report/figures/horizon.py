"""Category scores over the lead time, for rows that differ in nothing but how far they look ahead."""

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.classes import CATEGORY_NAMES
from semgrid_eval.report.claims.paper import paper_value
from semgrid_eval.report.estimates.bootstrap import LABELS, RowScores, Scores
from semgrid_eval.report.figures.style import PALETTE, PAPER_MARKS, SETTINGS, Plot, evidence, finish, paper_note, short
from semgrid_eval.report.rows.settings import settings_but


def horizon_lines(scores: Scores) -> list[list[RowScores]]:
    """Return the rows of one run with the same targets that differ in the horizon alone, by lead; at least two."""
    lines: dict[object, dict[float, RowScores]] = {}
    for entry in scores.values():
        key = (entry.row.run, entry.row.targets, settings_but(entry.row, "horizon_steps"))
        lines.setdefault(key, {}).setdefault(_lead_s(entry), entry)  # rows that mean the same are one point
    found = [[line[lead] for lead in sorted(line)] for line in lines.values() if len(line) > 1]
    return sorted(found, key=lambda line: not line[0].row.is_baseline)


def horizon_plots(scores: Scores) -> list[Plot]:
    """Draw category scores over the lead time with intervals, where a model was scored at several."""
    lines = horizon_lines(scores)
    if not lines:
        return []
    drawn = {entry.row.name: entry for line in lines for entry in line}
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(11.3, 3.0), layout="constrained")
        for axes, category in zip(figure.subplots(1, len(CATEGORY_NAMES), sharex=True), CATEGORY_NAMES, strict=True):
            for index, line in enumerate(lines):
                _line(axes, line, category, PALETTE[index % len(PALETTE)])
            axes.set_title(LABELS[category], loc="left", fontweight="bold")
            axes.set_xticks(leads := sorted({_lead_s(e) for e in drawn.values()}), [f"{lead:.2f}" for lead in leads])
            axes.margins(x=0.12)
        figure.axes[0].set_ylabel("IoU")
        figure.axes[-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        figure.supxlabel("lead time / s: from the newest input to the target", fontsize=9)
        caption = "Category IoU over the lead time with 95% intervals, a line for rows that differ in the horizon alone"
        return [finish(figure, "horizon", "summary.csv", f"{caption} ({evidence(drawn)}){paper_note(drawn)}")]


def _line(axes: Axes, line: Sequence[RowScores], category: str, colour: str) -> None:
    leads = [_lead_s(entry) for entry in line]
    estimates = [entry.estimate(category) for entry in line]
    name = short(f"{line[0].row.name} \N{HORIZONTAL ELLIPSIS} {line[-1].row.name}")
    axes.plot(leads, [e.value for e in estimates], "o-", color=colour, label=name, markersize=4)
    low, high = [e.low for e in estimates], [e.high for e in estimates]
    axes.fill_between(leads, low, high, color=colour, alpha=0.18, linewidth=0)
    papers = [paper_value(entry.row.record.name, category) for entry in line]
    axes.plot(leads, papers, "D", markersize=4, **(PAPER_MARKS | {"markeredgecolor": colour}))


def _lead_s(entry: RowScores) -> float:
    return entry.row.results[0].record.lead_s
