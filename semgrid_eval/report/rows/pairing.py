"""Which row is compared with which, by what rows are and by their targets, never by names; and how settings differ."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from semgrid_eval.classes import MEAN_KNOWN
from semgrid_eval.report.estimates.bootstrap import Scores
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Row, comparable, key_of

HEADLINE = MEAN_KNOWN
_UNSET = "not set"
_OF_TARGETS = ("grid.", "window.", "validation_window", "validation_split", "train_split", "hold_out", "mask_mode")
"""Starts of the keys of settings that decide the targets; with `hold_out`, what is scored is of `train_split`."""


@dataclass(frozen=True)
class Headline:
    """The best row of the main group of `compared` rows, the rows it is measured against, and the best of all rows."""

    compared: int
    best: Row
    overall: Row  # the best of the rows with the same targets, whatever else they are asked
    sharing: int  # how many these are
    next_best: Row | None  # the second best row of the main group
    rival: Row | None  # the best row there of the other kind (baseline or not), else the next best
    reference: Row | None  # the baseline of the best row


def by_question(rows: Sequence[Row]) -> list[list[Row]]:
    """Group rows by what they are asked, in the order in which this first appears.

    Rows answer the same question if they have the same targets, sensors, number of inputs, frames between them and
    horizon, and if inputs are moved to the target's time for all of them or for none, and are disturbed alike.
    """
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(row.question, []).append(row)
    return list(groups.values())


def reference_of(row: Row, rows: Sequence[Row]) -> Row | None:
    """Choose the baseline that a row is measured against, None for a baseline and where there is none.

    It is a baseline with the same targets and disturbance that looks as many frames ahead. Of these, the one is taken
    that shares more with the row, in this order: the run, the sensors, whether inputs are moved to the target's time,
    the number of inputs, the frames between them; then one that does not learn; then the first in the matrix.
    """
    if row.is_baseline:
        return None
    baselines = (other for other in rows if other.is_baseline and comparable(row, other))
    alike = (other for other in baselines if other.disturbed == row.disturbed)
    choices = [other for other in alike if row.is_stream or _frames_ahead(other) == _frames_ahead(row)]
    return max(choices, key=lambda other: _nearness(row, other), default=None)


def main_group(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the question that most rows answer; of equally many, the one that comes first.

    Rows that are told of the truth, or whose inputs are disturbed, are left out, unless there are no others.
    """
    usual = [row for row in rows if not row.uses_truth and not row.disturbed]
    return max(by_question(usual or rows), key=len, default=[])


def way_of(row: Row, rows: Sequence[Row]) -> tuple[Row, Row] | None:
    """Find the ends of the way that a row is measured by: what anybody has, and what nobody exceeds.

    Both have the same targets and look as many frames ahead, and are rather of the same run. None for such rows
    themselves, and where an end is missing.
    """
    if row.is_stream:  # its delay is part of what it is: `report.tables.streams` compares streams
        return None
    alike = [other for other in rows_alike(row, rows) if not other.disturbed]
    # The mask M depends on inputs, so an end that sees the same ones is nearer; of several, the first is taken.
    highest = [other for other in alike if other.record.facts.bound == "upper"]
    upper = max(highest, key=lambda other: _nearness(row, other), default=None)
    lowest = [other for other in alike if other.record.facts.bound == "lower" and other.record.facts.translate]
    lower = max(lowest, key=lambda other: _nearness(upper or row, other), default=None)
    return None if lower is None or upper is None or row in (lower, upper) else (lower, upper)


def rows_alike(row: Row, rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the same targets that look as many frames ahead, itself among them."""
    alike = [other for other in rows if comparable(row, other)]
    return [other for other in alike if _frames_ahead(other) == _frames_ahead(row)]


def told_beside(row: Row, rows: Sequence[Row]) -> list[Row]:
    """Return the rows told of the truth that a row is seen beside: of each model those nearest to what it is asked."""
    told = [other for other in rows_alike(row, rows) if other.uses_truth]
    nearest: dict[str, tuple[bool, ...]] = {}
    for other in told:
        model = other.record.facts.model
        nearest[model] = max(nearest.get(model, ()), _nearness(row, other))
    return [other for other in told if _nearness(row, other) == nearest[other.record.facts.model]]


def headline(scores: Scores) -> Headline | None:
    """Find the best row among those that answer the main question; None where nothing is scored."""
    finite = (entry.row for entry in scores.values() if np.isfinite(entry.mean[HEADLINE]))
    rows = [row for row in finite if not row.uses_truth and not row.is_oracle]
    if not rows:
        return None
    group = main_group(rows)

    def mean(row: Row) -> float:
        return scores[row.name].mean[HEADLINE]

    best = max(group, key=mean)
    next_best = max((row for row in group if row != best), key=mean, default=None)
    others = [row for row in group if row.is_baseline != best.is_baseline]
    rival = max(others, key=mean, default=next_best)
    sharing = [row for row in rows if comparable(row, best) and row.disturbed == best.disturbed]
    overall = max(sharing, key=mean)
    return Headline(len(group), best, overall, len(sharing), next_best, rival, reference_of(best, rows))


def shared_windows(row: Row, other: Row) -> int:
    """Count the target frames that both rows are scored on."""
    mine, theirs = ({key_of(w) for w in each.results[0].record.windows} for each in (row, other))
    return len(mine & theirs)


VERDICTS = {"gain": "clearly better", "loss": "clearly worse", "open": "not clearly different"}
"""What verdicts are called on a page."""


def verdict(difference: Estimate) -> str:
    """Put a difference into one word: gain, loss or open (the interval includes zero, or there is none)."""
    return "gain" if difference.low > 0 else "loss" if difference.high < 0 else "open"


def _frames_ahead(row: Row) -> tuple[int, float | None]:
    facts = row.record.facts
    return facts.horizon_steps * facts.step_frames, facts.lead_ms


def _nearness(row: Row, other: Row) -> tuple[bool, ...]:
    """Order baselines by how much of the row's run and question they share."""
    mine, theirs = row.record.facts, other.record.facts
    shared = (
        row.run == other.run,
        mine.sensors == theirs.sensors,
        mine.translate == theirs.translate,
        mine.inputs == theirs.inputs,
    )
    plain = theirs.stream is None or (theirs.stream.moved and theirs.bound == "lower")
    return (*shared, mine.step_frames == theirs.step_frames, not theirs.learns, plain)


def settings_of(row: Row) -> Mapping[str, object]:
    """Return all that determined a row's numbers, nested settings under dotted names.

    Sensors that neither its inputs nor its target use are left out: a grid may list more than a row needs.
    """
    found = row.results[0].settings
    used = {*row.record.facts.sensors, *found.get("grid.target", ())}
    unused = {key for key in found if key.startswith("grid.sensors.") and key.split(".")[2] not in used}
    return {key: value for key, value in found.items() if key not in unused}


def changed_settings(before: Mapping[str, object], after: Mapping[str, object]) -> dict[str, str]:
    """Say in words which flat settings differ, by key: `mask_mode exclude to off`."""
    keys = [*before, *(key for key in after if key not in before)]
    pairs = [(key, before.get(key, _UNSET), after.get(key, _UNSET)) for key in keys]
    return {key: f"{key} {_text(first)} to {_text(second)}" for key, first, second in pairs if first != second}


def changed_targets(before: Mapping[str, object], after: Mapping[str, object]) -> list[str]:
    """Say which of the settings that differ decide what the targets are."""
    return [text for key, text in changed_settings(before, after).items() if key.startswith(_OF_TARGETS)]


def settings_but(row: Row, *left_out: str) -> tuple[tuple[str, str], ...]:
    """Return a row's settings, to compare and to group by, without those whose last part is `left_out`."""
    kept = {key: value for key, value in settings_of(row).items() if key.rpartition(".")[2] not in left_out}
    return tuple(sorted((key, repr(value)) for key, value in kept.items()))


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(part) for part in value) or "none"
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
