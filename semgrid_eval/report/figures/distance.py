"""Scores by distance from the vehicle, for the rows that are asked what most rows are asked."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.report.estimates.bootstrap import Parts, RowScores, shared_iou
from semgrid_eval.report.figures import style
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import main_group, told_beside

_CAPTION = "IoU by distance from the vehicle, with 95% intervals, of rows with the commonest inputs, sensors and lead"


def distance_plots(parts: Parts, rows: Sequence[Row]) -> list[style.Plot]:
    """Draw a panel for each category over the bands of distance; nothing where results do not know these."""
    lines = _lines(parts, rows)
    if not lines or len(parts) < 2:
        return []
    strokes, iou = style.line_styles([line[0].row for line in lines]), shared_iou([line[0] for line in lines])
    with mpl.rc_context(style.SETTINGS):
        rows_of_panels, columns = style.panel_grid(len(iou.compared))
        figure = Figure(figsize=(style.WIDE_IN, 2.7 * rows_of_panels), layout="constrained")
        panels = style.draw_panels(figure, [iou.labels[column] for column in iou.compared], sharex=True)
        for axes, column in zip(panels, iou.compared, strict=True):
            for line, stroke in zip(lines, strokes, strict=True):
                _draw(axes, line, column, stroke)
            axes.set_xticks(range(len(parts)), [_short_band(name) for name in parts], fontsize=7)
        panels[0].set_ylabel("IoU")
        legend = panels[columns - 1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        style.mark_legend(legend, [[line[0].row] for line in lines])
        figure.supxlabel("distance / m", fontsize=9)
        caption = f"{_CAPTION} ({style.evidence({line[0].row.name: line[0] for line in lines})})."
        return [style.finish(figure, "distance", "summary.csv", caption)]


def _short_band(name: str) -> str:
    """Shorten `20 to 40 m` to what fits below a tick."""
    return name.removesuffix(" m").replace(" to ", "\N{EN DASH}").replace("beyond ", "> ")


def _lines(parts: Parts, rows: Sequence[Row]) -> list[list[RowScores]]:
    """Return the scores by band of the rows that have some in each."""
    group = main_group([row for row in rows if row.results])
    beside = [*group, *told_beside(group[0], rows)] if group else []
    alike = [row for row in rows if row in beside]
    found = [[scores[row.name] for scores in parts.values() if row.name in scores] for row in alike]
    return [line for line in found if len(line) == len(parts)]


def _draw(axes: Axes, line: Sequence[RowScores], column: str, stroke: dict[str, Any]) -> None:
    row, estimates, places = line[0].row, [entry.estimate(column) for entry in line], range(len(line))
    values, label = [each.value for each in estimates], style.short(row.name)
    drawn: list[Artist] = [*axes.plot(places, values, marker="o", markersize=3, label=label, **stroke)]
    low, high = [each.low for each in estimates], [each.high for each in estimates]
    drawn.append(axes.fill_between(places, low, high, color=stroke["color"], alpha=0.1, linewidth=0))
    style.mark([row], *drawn)
