"""The figures behind the scores: how honest certainty is, and what depth and features of the network buy."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.report.comparison import HEADLINE
from semgrid_eval.report.estimates import RowScores
from semgrid_eval.report.figure import INK, PALETTE, SETTINGS, STROKES, Plot, finish, short
from semgrid_eval.report.where import Where


class Build(NamedTuple):
    """How a row's network is built and what came of it."""

    name: str
    depth: int
    features: int
    iou: float
    window_ms: float


def calibration_plots(found: Sequence[Where]) -> list[Plot]:
    """Draw the share of right cells over certainty, for the rows whose certainty varies."""
    curves = [(entry, table) for entry in found if len(table := entry.calibration()) > 1]
    if not curves:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(4.6, 3.8), layout="constrained")
        axes = figure.add_subplot()
        axes.plot([0, 1], [0, 1], color=INK, linewidth=0.8, linestyle=":")
        for index, (entry, table) in enumerate(curves, start=1):
            label = f"{short(entry.row.name)}, error {entry.calibration_error():.3f}"
            stroke = STROKES[index // len(PALETTE) % len(STROKES)]
            colour = PALETTE[index % len(PALETTE)]
            axes.plot(table.certainty, table.right, stroke, marker="o", markersize=3, color=colour, label=label)
        axes.set(xlabel="certainty", ylabel="share of right cells", xlim=(0, 1), ylim=(0, 1))
        axes.legend(fontsize=8)
        caption = "How often a model is right when it is so certain (first repeat); it is honest on the dotted line."
        return [finish(figure, "calibration", "calibration.csv", caption)]


def architecture_plots(scores: Mapping[str, RowScores]) -> list[Plot]:
    """Draw score and time against depth and features, where rows differ in them."""
    builds = [build for entry in scores.values() if (build := _build(entry)) is not None]
    if len({(build.depth, build.features) for build in builds}) < 2:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(9.6, 3.2), layout="constrained")
        score, time, front = figure.subplots(1, 3)
        for index, features in enumerate(sorted({build.features for build in builds})):
            mine = sorted((b for b in builds if b.features == features), key=lambda build: build.depth)
            style = {"color": PALETTE[index % len(PALETTE)], "label": f"{features} features", "markersize": 4}
            score.plot([b.depth for b in mine], [b.iou for b in mine], "o-", **style)
            time.plot([b.depth for b in mine], [b.window_ms for b in mine], "o-", **style)
            front.plot([b.window_ms for b in mine], [b.iou for b in mine], "o", **style)
        _front_line(front, builds)
        depths = sorted({build.depth for build in builds})
        score.set(xlabel="depth", ylabel="mean class IoU", xticks=depths)
        time.set(xlabel="depth", ylabel="ms a window", xticks=depths)
        front.set(xlabel="ms a window", ylabel="mean class IoU")
        score.legend(fontsize=8)
        caption = "What the network's depth and features buy: mean class IoU without unknown, time, and their front."
        return [finish(figure, "architecture", "summary.csv and report.json", caption)]


def _front_line(axes: Axes, builds: Sequence[Build]) -> None:
    """Join the networks that no other network beats in both time and score."""
    best, front = -np.inf, []
    for build in sorted(builds, key=lambda each: (each.window_ms, -each.iou)):
        if build.iou > best:
            best = build.iou
            front.append(build)
    axes.plot([b.window_ms for b in front], [b.iou for b in front], color=INK, linewidth=0.8, linestyle="--", zorder=0)


def _build(entry: RowScores) -> Build | None:
    record = entry.row.results[0].record
    network: Any = record.config.get("network")
    if (
        not isinstance(network, dict)
        or not {"depth", "features"} <= set(network)
        or not np.isfinite(entry.mean[HEADLINE])
    ):
        return None
    seconds = float(np.mean([result.record.predict_seconds for result in entry.row.results]))
    window_ms = 1000 * seconds / max(1, entry.row.windows)
    return Build(entry.row.name, int(network["depth"]), int(network["features"]), entry.mean[HEADLINE], window_ms)
