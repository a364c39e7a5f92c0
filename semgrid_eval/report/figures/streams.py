"""Streaming IoU over the delay of answers, a curve for each strategy."""

from collections.abc import Sequence

import matplotlib as mpl
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, shared_iou
from semgrid_eval.report.estimates.streams import Strategy, facts_of, record_of
from semgrid_eval.report.figures.style import SETTINGS, Plot, evidence, finish, line_style, mark, mark_legend, short
from semgrid_eval.report.rows.pairing import HEADLINE

_CAPTION = (
    "Streaming IoU by the delay of answers: median time from the beginning of the work on a frame to its answer; large "
    "marks are at the latency that was measured. Bands are 95% intervals; broken lines are "
    "bounds, which know when answers will be used. Misses before the first answer count. "
)
STREAM_COLUMNS = ("row", "strategy", "added_ms", "delay_ms", "age_ms", "lead_ms", "misses", "evaluations")


def stream_frame(found: Sequence[Strategy]) -> pd.DataFrame:
    """Return one line for each row with a stream: its strategy, its times and its categories."""
    iou = shared_iou(each.measured for each in found)
    columns = [name for name in iou.labels if name not in iou.classes.names[1:]]
    lines = [
        {
            "row": entry.row.name,
            "strategy": strategy.name,
            "added_ms": facts_of(entry.row).added_ms,
            "delay_ms": record_of(entry.row).latency_ms,
            "age_ms": record_of(entry.row).age_ms,
            "lead_ms": record_of(entry.row).lead_ms,
            "misses": record_of(entry.row).misses,
            "evaluations": record_of(entry.row).evaluations,
            **{name: entry.mean[name] for name in columns},
        }
        for strategy in found
        for entry in strategy.entries
    ]
    return pd.DataFrame(lines, columns=[*STREAM_COLUMNS, *columns])


def stream_plots(found: Sequence[Strategy], moving: Scores) -> list[Plot]:
    """Draw the mean of all cells and vehicles near moving actors over the delay; nothing where no delay varies."""
    curves = [each for each in found if len(each.entries) > 1]
    if not curves:
        return []
    iou = shared_iou(each.measured for each in curves)
    panels = [("all cells", HEADLINE, {entry.row.name: entry for each in curves for entry in each.entries})]
    if moving and iou.moving:
        panels.append(("near moving actors", iou.moving[0], dict(moving)))
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(5.2 * len(panels), 3.8), layout="constrained")
        places = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (where, column, scores) in zip(places, panels, strict=True):
            for index, strategy in enumerate(curves):
                _draw(axes, strategy, scores, column, index)
            axes.set(xlabel="delay of answers, ms", ylabel="streaming IoU", title=f"{iou.labels[column]}, {where}")
        legend = figure.axes[-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        shown = (each for each in curves if any(entry.row.name in panels[-1][2] for entry in each.entries))
        mark_legend(legend, [[each.measured.row] for each in shown])
        whole = {entry.row.name: entry for each in curves for entry in each.entries}
        return [finish(figure, "streams", "streams.csv", f"{_CAPTION}{evidence(whole)}.")]


def _draw(axes: Axes, strategy: Strategy, scores: Scores, column: str, index: int) -> None:
    entries = [scores[entry.row.name] for entry in strategy.entries if entry.row.name in scores]
    if not entries:
        return
    delays = [record_of(entry.row).latency_ms for entry in entries]
    style = line_style(index) | {"linestyle": "--" if _is_bound(entries[0]) else "-"}
    estimates = [entry.estimate(column) for entry in entries]
    values, label = [each.value for each in estimates], short(strategy.name)
    drawn: list[Artist] = [*axes.plot(delays, values, marker="o", markersize=3, label=label, **style)]
    if (measured := scores.get(strategy.measured.row.name)) is not None:
        drawn += axes.plot([strategy.delay_ms], [measured.mean[column]], marker="o", markersize=8, **style)
    low, high = [each.low for each in estimates], [each.high for each in estimates]
    drawn.append(axes.fill_between(delays, low, high, color=style["color"], alpha=0.12))
    mark([strategy.measured.row], *drawn)


def _is_bound(entry: RowScores) -> bool:
    return entry.row.uses_truth or entry.row.is_oracle
