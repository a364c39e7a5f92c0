"""Which row is compared with which, and what the numbers then say in plain sentences."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgrid_eval.report.estimates.bootstrap import Estimate, Scores
from semgrid_eval.report.rows.load import Row

HEADLINE = "mean_known"
DIFFERENCE_COLUMNS = ("static_known", "small_static", "vehicles", "small_dynamic", HEADLINE)


@dataclass(frozen=True)
class Headline:
    """The best row of the main group of `compared` rows, and the rows it is measured against."""

    compared: int
    best: Row
    rival: Row | None  # the best row of the other kind (baseline or not), else the runner-up
    reference: Row | None  # the baseline of the best row's own experiment


def comparable(row: Row, other: Row) -> bool:
    """Tell whether rows may be subtracted: both have results, and these have the same targets, in whichever runs."""
    return row.targets == other.targets != ""


def reference_of(row: Row, rows: Sequence[Row]) -> Row | None:
    """Choose the baseline that a row is measured against: of its own experiment, else the nearest one.

    The nearest baseline shares run, horizon and, where possible, sensors; `DC`, which knows the motion, comes first.
    """
    if row.is_baseline:
        return None
    choices = [
        other
        for other in rows
        if other.is_baseline and other.run == row.run and other.record.horizon_steps == row.record.horizon_steps
    ]
    return max(choices, key=lambda other: _nearness(row, other), default=None)


def headline(scores: Scores) -> Headline | None:
    """Find the best row among those that answer the same question; None where nothing is scored."""
    rows = [entry.row for entry in scores.values() if np.isfinite(entry.mean[HEADLINE])]
    if not rows:
        return None
    group = _main_group(rows)
    best = max(group, key=lambda row: scores[row.name].mean[HEADLINE])
    others = [row for row in group if row.is_baseline != best.is_baseline]
    others = others or [row for row in group if row != best]
    rival = max(others, key=lambda row: scores[row.name].mean[HEADLINE], default=None)
    return Headline(len(group), best, rival, reference_of(best, rows))


def verdict(difference: Estimate) -> str:
    """Put a difference into one word: gain, loss or open (the interval includes zero, or there is none)."""
    if not difference.sure:
        return "open"
    return "gain" if difference.value > 0 else "loss"


def _nearness(row: Row, other: Row) -> tuple[bool, ...]:
    """Order baselines by how much of the row's question they share."""
    mine, theirs = row.record, other.record
    return (
        mine.experiment == theirs.experiment and theirs.model == "BL",
        mine.sensors == theirs.sensors,
        mine.translate == theirs.translate,
        theirs.experiment == "DC",
    )


def _main_group(rows: Sequence[Row]) -> list[Row]:
    """Take the rows of one run, horizon and set of inputs: those of experiment DC, else the largest such group."""
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        key = (row.run, row.record.horizon_steps, row.record.sensors, row.record.inputs)
        groups.setdefault(key, []).append(row)
    return max(groups.values(), key=lambda group: (any(row.record.experiment == "DC" for row in group), len(group)))
