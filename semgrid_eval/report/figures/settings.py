"""What settings of a model buy: score and time of rows that differ in one or two numeric settings alone."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores
from semgrid_eval.report.figures.style import (
    INK,
    PALETTE,
    SETTINGS,
    WIDE_IN,
    Plot,
    evidence,
    finish,
    mark,
    mark_legend,
    short,
)
from semgrid_eval.report.rows.pairing import HEADLINE, settings_of

COLUMNS = ("figure", "row", "setting", "value", "by", "by_value", "parameters", "iou", "low", "high")
_ASIDE = 0.02  # of the axis: how far lines stand apart, so that their intervals can be told apart
_MOST_SETS = 4
_LEFT_OUT = "horizon_steps"  # scores over the lead time have a figure of their own


@dataclass(frozen=True)
class Varied:
    """Rows that differ in the numeric settings `keys` alone, the first of which is drawn along the axis."""

    keys: tuple[str, ...]
    rows: tuple[RowScores, ...]

    def value(self, entry: RowScores, at: int = 0) -> Any:  # noqa: ANN401 - whichever number a setting is
        """Return a row's value of a setting; nothing where there is only one setting."""
        return settings_of(entry.row)[self.keys[at]] if at < len(self.keys) else None

    def lines(self) -> list[list[RowScores]]:
        """Return the rows of each value of the second setting, ordered by the first."""
        lines: dict[Any, list[RowScores]] = {}
        for entry in sorted(self.rows, key=lambda entry: (self.value(entry, 1) or 0, self.value(entry))):
            lines.setdefault(self.value(entry, 1), []).append(entry)
        return list(lines.values())


def settings_frame(scores: Scores) -> pd.DataFrame:
    """Return one line for each row of each figure: `COLUMNS`."""
    lines = []
    for index, varied in enumerate(varied_settings(scores)):
        setting, by = (*varied.keys, "")[:2]
        for entry in varied.rows:
            iou, parameters = entry.estimate(HEADLINE), entry.row.results[0].record.parameters
            values = (setting, varied.value(entry), by, varied.value(entry, 1), parameters)
            lines.append((_name(index), entry.row.name, *values, iou.value, iou.low, iou.high))
    return pd.DataFrame(lines, columns=list(COLUMNS)).astype({"parameters": "Int64"})


def settings_plots(scores: Scores) -> list[Plot]:
    """Draw score and time against settings, and against each other, where rows differ in nothing else."""
    return [_plot(varied, _name(index)) for index, varied in enumerate(varied_settings(scores))]


def _plot(varied: Varied, name: str) -> Plot:
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(WIDE_IN, 3.4), layout="constrained")
        score, time, front = panels = figure.subplots(1, 3)
        for index, line in enumerate(lines := varied.lines()):
            _draw_line(panels, varied, line, index, aside=index - (len(lines) - 1) / 2)
        _front_line(front, varied.rows)
        places = sorted({varied.value(entry) for entry in varied.rows})
        for axes in (score, time):
            axes.set_xticks(places, [f"{place:g}" for place in places])
            axes.set_xlabel(_word(varied.keys[0]))
            axes.margins(x=0.15)
        slowest_ms = 1.1 * max(_window_ms(entry) for entry in varied.rows)
        score.set(ylabel="mean IoU of known classes")
        time.set(ylabel="time of a prediction / ms", ylim=(0, slowest_ms))
        front.set(xlabel="time of a prediction / ms", ylabel="mean IoU of known classes", xlim=(0, slowest_ms))
        legend = front.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        mark_legend(legend, [[entry.row for entry in line] for line in lines])
        return finish(figure, name, "settings.csv", _caption(varied))


def _draw_line(panels: Sequence[Axes], varied: Varied, line: list[RowScores], index: int, *, aside: float) -> None:
    """Draw the rows of one value of the second setting into the panels of score, time and both."""
    score, time, front = panels
    colour, label = PALETTE[index % len(PALETTE)], _label(varied, line[0])
    reach = float(np.ptp([varied.value(entry) for entry in varied.rows]))
    places = [varied.value(entry) + aside * _ASIDE * reach for entry in line]
    estimates, times = [entry.estimate(HEADLINE) for entry in line], [_window_ms(entry) for entry in line]
    drawn: list[Artist] = []
    for axes, x in ((score, places), (front, times)):
        for at, estimate in zip(x, estimates, strict=True):
            drawn += axes.plot([at, at], [estimate.low, estimate.high], color=colour, linewidth=0.8, alpha=0.7)
    values = [estimate.value for estimate in estimates]
    for axes, x, y, form in ((score, places, values, "o-"), (time, places, times, "o-"), (front, times, values, "o")):
        drawn += axes.plot(x, y, form, color=colour, label=label, markersize=4)
    for entry, place in zip(line, zip(times, values, strict=True), strict=True):
        text = f"{varied.value(entry):g}"
        drawn.append(front.annotate(text, place, (4, -9), textcoords="offset points", fontsize=7))
    mark([entry.row for entry in line], *drawn)


def _front_line(axes: Axes, entries: Sequence[RowScores]) -> None:
    """Join the rows that no other row beats in both time and score."""
    points = sorted((_window_ms(entry), -entry.mean[HEADLINE]) for entry in entries)
    front = [p for i, p in enumerate(points) if all(p[1] < before[1] for before in points[:i])]
    axes.plot([ms for ms, _ in front], [-loss for _, loss in front], color=INK, linewidth=0.8, linestyle="--", zorder=0)


def _window_ms(entry: RowScores) -> float:
    return float(np.mean(entry.row.window_ms))


def _label(varied: Varied, entry: RowScores) -> str:
    """Name a line by its value of the second setting, or by the model where there is one line."""
    if len(varied.keys) == 1:
        return short(entry.row.record.facts.model)
    return f"{_word(varied.keys[1])} {varied.value(entry, 1):g}"


def _caption(varied: Varied) -> str:
    rows = evidence({entry.row.name: entry for entry in varied.rows})
    return (
        f"Rows that differ in {' and '.join(varied.keys)} alone: score with 95% interval, time of a window's "
        f"prediction, and both, where numbers are {_word(varied.keys[0])} and the dashed line joins the rows that "
        f"none beats in both ({rows}). Times stand in timings.csv."
    )


def _word(key: str) -> str:
    """Name a setting by its last part."""
    return key.rpartition(".")[2].replace("_", " ")


def _name(index: int) -> str:
    return f"settings-{index + 1}" if index else "settings"


def varied_settings(scores: Scores) -> list[Varied]:
    """Find the sets of rows of one model, run and targets that differ in one or two numeric settings, largest first."""
    models: dict[object, list[RowScores]] = {}
    for entry in scores.values():
        if np.isfinite(entry.mean[HEADLINE]):
            key = (entry.row.run, entry.row.targets, entry.row.record.facts.model)
            models.setdefault(key, []).append(entry)
    sets = [each for entries in models.values() for each in _sets(entries)]
    found: list[Varied] = []
    for each in sorted(sets, key=lambda each: (-len(each.rows), len(each.keys))):
        drawn = {entry.row.name for other in found for entry in other.rows}
        if sum(entry.row.name not in drawn for entry in each.rows) > 1:
            found.append(each)
    return found[:_MOST_SETS]


def _sets(entries: Sequence[RowScores]) -> Iterator[Varied]:
    """Group the rows of a model by all settings but one or two that vary."""
    flat = {entry.row.name: dict(settings_of(entry.row)) for entry in entries}
    numeric = _varying(list(flat.values()))
    for keys in (*((key,) for key in numeric), *itertools.combinations(numeric, 2)):
        groups: dict[str, dict[Any, RowScores]] = {}
        for entry in entries:
            mine = flat[entry.row.name]
            rest = repr(sorted((key, repr(value)) for key, value in mine.items() if key not in keys))
            # Rows that mean the same are one point.
            groups.setdefault(rest, {}).setdefault(tuple(mine.get(key) for key in keys), entry)
        for group in groups.values():
            distinct = [len(set(values)) for values in zip(*group, strict=True)]
            # Points differ in each setting, and some of them in one setting only.
            if min(distinct) > 1 and (len(distinct) == 1 or len(group) > max(distinct)):
                along = keys if distinct[0] == max(distinct) else keys[::-1]
                yield Varied(along, tuple(group.values()))


def _varying(settings: Sequence[dict[str, object]]) -> list[str]:
    """List the settings that are numbers in all rows, and not the same in all."""
    return [
        key
        for key in settings[0]
        if not key.endswith(_LEFT_OUT)
        and all(isinstance(each.get(key), int | float) and not isinstance(each[key], bool) for each in settings)
        and len({each[key] for each in settings}) > 1
    ]
