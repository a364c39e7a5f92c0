"""The paper: its claims as named comparisons between rows, its class-wise table (supplement, A1), and its settings."""

import itertools
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Literal

import numpy as np
import pandas as pd

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.report.rows.load import Row, Run
from semgrid_eval.scores.metrics.table import IOU

MARGIN = 0.02
"""IoU: differences within it count as close, and a loss within it as none."""
WINDOW_MS = "window_ms"
"""The score of a check that compares the time of a prediction."""

Rule = Literal["better", "close", "at least", "slower"]
Pair = tuple[str, str]

_LARGE = ("static_known", "vehicles")
_SMALL = ("small_static", "small_dynamic")
_MEAN = "mean_known"
_BASELINES = ("BL-DC", "BL-Fuse", "BL-Table", "BL-Flow")
_HORIZONS = ("DC", "PH1", "PH2", "PH3")
_RESIDUAL = (
    *((first, other) for first in ("RN-DC", "RN-Flow-DC") for other in (*_BASELINES, "ED-DC")),
    *((first, other) for first in ("RN-SL5", "RN-Flow-SL5") for other in ("BL-DC", "BL-Flow", "BL-Fuse-SL5", "ED-SL5")),
)
_BUILD = re.compile(r"ED-d(\d+)-f(\d+)")
_DEFAULT_ENDS = {"deeper": ("ED-d4-f64", "ED-d2-f64"), "wider": ("ED-d3-f64", "ED-d3-f16")}


@dataclass(frozen=True)
class Check:
    """One comparison: the mean over pairs of rows of the first one's score minus the second's."""

    pairs: tuple[Pair, ...]
    score: str  # a column of scores, or `WINDOW_MS`
    rule: Rule = "better"  # what has to hold of the difference and its interval
    over: Pair | None = None  # a pair whose difference is taken off, where leads are compared
    region: str = ""  # `moving` where only the cells near moving actors count

    @property
    def weights(self) -> dict[str, float]:
        """The weight of each row's score."""
        share = 1 / len(self.pairs)
        weights = {name: sign for pair in self.pairs for name, sign in zip(pair, (share, -share), strict=True)}
        return weights | dict(zip(self.over or (), (-1.0, 1.0), strict=False))

    @property
    def text(self) -> str:
        """The comparison in names of rows."""
        texts = [f"{first} \N{MINUS SIGN} {second}" for first, second in self.pairs]
        if self.over is not None:
            return f"({texts[0]}) \N{MINUS SIGN} ({self.over[0]} \N{MINUS SIGN} {self.over[1]})"
        return texts[0] if len(texts) == 1 else f"mean of {', '.join(texts)}"


@dataclass(frozen=True)
class Claim:
    """A claim: its name, what it says, and the comparisons that all have to hold."""

    name: str
    text: str
    checks: tuple[Check, ...]


def claims(rows: Iterable[str]) -> tuple[Claim, ...]:
    """List the claims; which networks stand for deeper and wider depends on the names of the rows at hand."""
    builds = [(name, int(found[1]), int(found[2])) for name in rows if (found := _BUILD.fullmatch(name))]
    third = f"With a third input, ED-SL3 is at least equal to ED-SL2 (at most {MARGIN} IoU below)"
    return (
        *(claim for baseline in _BASELINES for claim in _over(baseline)),
        *_without_translation(),
        *_several_sensors(),
        Claim("third-input", third, _each((*_LARGE, *_SMALL), ("ED-SL3", "ED-SL2"), rule="at least")),
        *_horizons(),
        *_builds(builds),
        *(claim for pair in _RESIDUAL for claim in _residual_over(pair)),
    )


def _over(baseline: str) -> tuple[Claim, ...]:
    pair = ("ED-DC", baseline)
    large = f"ED-DC is better than {baseline} on static classes and vehicles"
    moving = f"ED-DC is better than {baseline} on moving vehicles alone"
    small = f"ED-DC is at least equal to {baseline} on small classes (at most {MARGIN} IoU below)"
    return (
        Claim(f"large-{baseline}", large, _each(_LARGE, pair)),
        Claim(f"moving-{baseline}", moving, (Check((pair,), "vehicles", region="moving"),)),
        Claim(f"small-{baseline}", small, _each(_SMALL, pair, rule="at least")),
    )


def _without_translation() -> tuple[Claim, ...]:
    close = f"Without translated inputs, ED-NT is close to ED-DC on static classes and vehicles (within {MARGIN} IoU)"
    return (
        Claim("untranslated-large", close, _each(_LARGE, ("ED-NT", "ED-DC"), rule="close")),
        Claim("untranslated-small", "ED-NT falls behind ED-DC on small classes", _each(_SMALL, ("ED-DC", "ED-NT"))),
    )


def _several_sensors() -> tuple[Claim, ...]:
    good = f"Fusing two sensors, ED-Sp1 is as good as ED-DC with one (within {MARGIN} IoU)"
    lead = f"ED-Sp2 is as far above BL-Sp2 as ED-DC above BL-DC, or farther (at most {MARGIN} IoU less)"
    larger = "On static classes, ED-Sp2's lead over its baseline is larger than ED-DC's"
    far, near = ("ED-Sp2", "BL-Sp2"), ("ED-DC", "BL-DC")
    return (
        Claim("two-sensors", good, _each((*_LARGE, *_SMALL), ("ED-Sp1", "ED-DC"), rule="close")),
        Claim("blind-band", "With a blind band, ED-Sp2 is below ED-DC", _each((_MEAN,), ("ED-DC", "ED-Sp2"))),
        Claim("blind-band-lead", lead, (Check((far,), _MEAN, "at least", over=near),)),
        Claim("blind-band-static", larger, (Check((far,), "static_known", over=near),)),
    )


def _horizons() -> tuple[Claim, ...]:
    falls = [Check(((f"ED-{sooner}", f"ED-{later}"),), _MEAN) for sooner, later in itertools.pairwise(_HORIZONS)]
    stays = [check for horizon in _HORIZONS[1:] for check in _each(_LARGE, (f"ED-{horizon}", f"BL-{horizon}"))]
    above = "At longer horizons, ED stays better than its baseline on static classes and vehicles"
    return (
        Claim("horizon-falls", "ED's scores fall with the horizon", tuple(falls)),
        Claim("horizon-lead", above, tuple(stays)),
    )


def _builds(builds: list[tuple[str, int, int]]) -> tuple[Claim, ...]:
    """Compare the deepest with the shallowest networks of equal width, and likewise the widest with the narrowest."""
    found = []
    for kind, varied, fixed in (("deeper", 1, 2), ("wider", 2, 1)):
        groups: dict[object, list[tuple[str, int, int]]] = {}
        for build in builds:
            groups.setdefault(build[fixed], []).append(build)
        ends = [(max(g, key=lambda b: b[varied]), min(g, key=lambda b: b[varied])) for g in groups.values()]
        pairs = tuple((first[0], last[0]) for first, last in ends if first != last) or (_DEFAULT_ENDS[kind],)
        found += [
            Claim(f"{kind}-better", f"A {kind} network is better", (Check(pairs, _MEAN),)),
            Claim(f"{kind}-slower", f"A {kind} network is slower", (Check(pairs, WINDOW_MS, "slower"),)),
        ]
    return tuple(found)


def _residual_over(pair: Pair) -> tuple[Claim, ...]:
    """Compare the residual network, which is not the paper's, with what it has to be clear of."""
    first, second = pair
    moving = tuple(Check((pair,), score, region="moving") for score in ("vehicles", "person"))
    return (
        Claim(
            f"{first}-{second}", f"{first} is better than {second} in every category", _each((*_LARGE, *_SMALL), pair)
        ),
        Claim(
            f"{first}-moving-{second}", f"{first} is better than {second} on moving vehicles and persons alone", moving
        ),
    )


def _each(scores: Iterable[str], pair: Pair, *, rule: Rule = "better") -> tuple[Check, ...]:
    return tuple(Check((pair,), score, rule) for score in scores)


PAPER_SETTINGS = {
    "settings.depth": ("depth", 3),
    "settings.features": ("features", 64),
    "settings.training.batch": ("batch", 32),
    "settings.training.epochs": ("epochs", 40),
    "settings.training.updates_per_epoch": ("updates an epoch", 185),
    "settings.training.schedule.learning_rate": ("learning rate", 1e-3),
    "settings.training.schedule.drop_epoch": ("epoch after which the learning rate drops", 35),
    "settings.training.schedule.rate_after_drop": ("learning rate then", 1e-4),
}
"""What the supplement says of network and training: words and value by a result's setting."""
PAPER_DATASET = "cityscapes"
PAPER_REPEATS = 20
PAPER_WINDOWS = 500
"""One for each sequence of Cityscapes' validation set."""


def on_cityscapes(run: Run) -> bool:
    """Tell whether a run is of the paper's data set and classes, so that its values can stand beside the paper's."""
    return has_papers_classes(run) and {log.dataset for log in run.record.logs} == {PAPER_DATASET}


def has_papers_classes(run: Run) -> bool:
    """Tell whether a run's grids have the paper's classes, which its claims and values are about."""
    return all(row.classes.means(DEFAULT_CLASSES) for row in run.rows)


def in_paper(name: str) -> bool:
    """Tell whether the paper's table has a row of that name."""
    return name in paper_table()


def is_papers(row: Row) -> bool:
    """Tell whether the paper has a row of that name, and of the same classes."""
    return row.classes.means(DEFAULT_CLASSES) and in_paper(row.record.name)


def paper_value(row: Row, column: str) -> float:
    """Return the paper's value of a class or category for such a row, NaN where it has none."""
    return paper_table()[row.record.name].get(column, np.nan) if is_papers(row) else np.nan


@cache
def paper_table() -> dict[str, dict[str, float]]:
    """Return the paper's values by row name and class; the categories follow as means of the classes (reading 11)."""
    with resources.files("semgrid_eval.report").joinpath("data/table_a1.csv").open("rb") as stream:
        table = pd.read_csv(stream, index_col="experiment")[list(CLASS_NAMES)]
    categories = IOU.means(table.to_numpy(np.float64))
    whole = table.assign(**categories)
    return {str(name): {str(key): float(value) for key, value in row.items()} for name, row in whole.iterrows()}


def scaling(run: Run) -> str:
    """Say how the training of rows that the paper has, too, differs from the paper's; empty if none was trained."""
    rows = [row for row in run.rows if row.results and is_papers(row)]
    trained = [row for row in rows if row.results[0].record.seed is not None]
    if not trained:
        return ""
    settings = [result.settings for row in trained for result in row.results]
    found = [
        _difference(text, {each[key] for each in settings if key in each}, theirs)
        for key, (text, theirs) in PAPER_SETTINGS.items()
    ]
    found.append(_difference("repeats", {len(row.results) for row in trained}, PAPER_REPEATS))
    found.append(_difference("scored windows", {row.windows for row in rows}, PAPER_WINDOWS))
    sources = {log.dataset for log in run.record.logs}
    others = " and ".join(sorted(sources - {PAPER_DATASET}))
    place = "besides" if PAPER_DATASET in sources else "instead of"
    found.append(f"data {others} {place} Cityscapes" if others else "")
    told = ", ".join(filter(None, found))
    return f"Scaled from the paper's supplement: {told}." if told else "Trained as the paper's supplement says."


def _difference(text: str, ours: Iterable[object], theirs: float) -> str:
    values = sorted(set(ours), key=str)
    if not values or values == [theirs]:
        return ""
    shown = " or ".join("none" if value is None else f"{value:,}" for value in values)
    return f"{text} {shown} instead of {theirs:,}"
