"""What depth and features of the network buy."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.files import digest_value
from semgrid_eval.report.estimates.bootstrap import Estimate, RowScores, Scores
from semgrid_eval.report.figures.style import INK, PALETTE, SETTINGS, Plot, evidence, finish
from semgrid_eval.report.rows.pairing import HEADLINE

BUILD_COLUMNS = ("row", "depth", "features", "parameters", "iou", "low", "high", "window_ms")

_ASIDE = 0.06  # of a depth: how far networks of other widths stand aside, so that their intervals can be told apart


class Build(NamedTuple):
    """How a row's network is built and what came of it; `setting` is equal where nothing else differs."""

    name: str
    depth: int
    features: int
    parameters: int | None
    iou: Estimate
    window_ms: float
    setting: str


def builds_of(scores: Scores) -> list[Build]:
    """List the networks whose rows differ in depth and features only: the largest such set."""
    sets: dict[str, list[Build]] = {}
    for entry in scores.values():
        if (build := _build(entry)) is not None:
            sets.setdefault(build.setting, []).append(build)
    several = [builds for builds in sets.values() if len({(b.depth, b.features) for b in builds}) > 1]
    return max(several, key=len, default=[])


def architecture_frame(scores: Scores) -> pd.DataFrame:
    """Return one line for each compared network: `BUILD_COLUMNS`."""
    lines = [
        (b.name, b.depth, b.features, b.parameters, b.iou.value, b.iou.low, b.iou.high, b.window_ms)
        for b in builds_of(scores)
    ]
    return pd.DataFrame(lines, columns=list(BUILD_COLUMNS)).astype({"parameters": "Int64"})


def architecture_plots(scores: Scores) -> list[Plot]:
    """Draw score and time against depth and features, and against each other, where rows differ in them."""
    builds = builds_of(scores)
    if not builds:
        return []
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(11.3, 3.4), layout="constrained")
        score, time, front = figure.subplots(1, 3)
        widths = sorted({build.features for build in builds})
        for index, features in enumerate(widths):
            mine = sorted((b for b in builds if b.features == features), key=lambda build: build.depth)
            aside = _ASIDE * (index - (len(widths) - 1) / 2)
            _build_lines((score, time, front), mine, PALETTE[index % len(PALETTE)], aside)
        _front_line(front, builds)
        for axes in (score, time):
            axes.set(xlabel="depth d: encoder blocks", xticks=sorted({build.depth for build in builds}))
            axes.margins(x=0.15)
        score.set(ylabel="mean class IoU without unknown")
        time.set(ylabel="time of a prediction / ms", ylim=(0, None))
        front.set(xlabel="time of a prediction / ms", ylabel="mean class IoU without unknown", xlim=(0, None))
        front.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        names = {build.name: scores[build.name] for build in builds}
        caption = "What depth and features of the network buy: score with 95% interval, time of a window's prediction,"
        caption += f" and both; the dashed line joins networks that none beats in both ({evidence(names)})."
        return [finish(figure, "architecture", "architecture.csv", caption)]


def _build_lines(panels: tuple[Axes, Axes, Axes], builds: Sequence[Build], colour: str, aside: float) -> None:
    score, time, front = panels
    depths, values = [b.depth + aside for b in builds], [b.iou.value for b in builds]
    times = [b.window_ms for b in builds]
    style: Any = {"color": colour, "label": f"{builds[0].features} features", "markersize": 4}
    for axes, x in ((score, depths), (front, times)):
        for at, build in zip(x, builds, strict=True):
            axes.plot([at, at], [build.iou.low, build.iou.high], color=colour, linewidth=0.8, alpha=0.7)
    score.plot(depths, values, "o-", **style)
    time.plot([b.depth for b in builds], times, "o-", **style)
    front.plot(times, values, "o", **style)
    for build in builds:
        place = (build.window_ms, build.iou.value)
        front.annotate(f"d{build.depth}", place, (4, -9), textcoords="offset points", fontsize=7)


def _front_line(axes: Axes, builds: Sequence[Build]) -> None:
    """Join the networks that no other network beats in both time and score."""
    best, front = -np.inf, []
    for build in sorted(builds, key=lambda each: (each.window_ms, -each.iou.value)):
        if build.iou.value > best:
            best = build.iou.value
            front.append(build)
    x, y = [b.window_ms for b in front], [b.iou.value for b in front]
    axes.plot(x, y, color=INK, linewidth=0.8, linestyle="--", zorder=0)


def _build(entry: RowScores) -> Build | None:
    record, row = entry.row.results[0].record, entry.row.record
    network: Any = record.config.get("settings")
    known = isinstance(network, dict) and {"depth", "features"} <= set(network)
    if entry.row.is_baseline or not known or not np.isfinite(entry.mean[HEADLINE]):
        return None
    rest = {key: value for key, value in network.items() if key not in ("depth", "features")}
    setting = digest_value([{**record.config, "settings": rest}, row.horizon_steps, str(entry.row.run)])
    depth, features = int(network["depth"]), int(network["features"])
    window_ms = float(np.mean(entry.row.window_ms))
    return Build(entry.row.name, depth, features, record.parameters, entry.estimate(HEADLINE), window_ms, setting)
