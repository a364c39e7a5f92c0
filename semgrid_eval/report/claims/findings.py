"""What a run says about the paper's claims: each one holds, does not hold, stays undecided or was not run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
import pandas as pd

from semgrid_eval.report.claims.claims import MARGIN, WINDOW_MS, Check, Claim, Rule, claims, has_papers_classes
from semgrid_eval.report.estimates.bootstrap import Scores, weighted_sum
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Run
from semgrid_eval.report.tables.numbers import ABSENT, MINUS, finite, interval_phrase
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, plain_table
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.words import plural

TRUTH = "logs that tell where true actors move"
SAME_TARGETS = "rows with the same targets"
FINDING_COLUMNS = (
    *("run", "name", "claim", "verdict", "comparison", "score", "region", "rule", "margin", "comparison_verdict"),
    *("difference", "low", "high", "windows", "missing"),
)


class Verdict(StrEnum):
    """What numbers say of a claim."""

    HOLDS = "holds"
    FAILS = "does not hold"
    OPEN = "undecided"
    NOT_RUN = "not run"


@dataclass(frozen=True)
class Outcome:
    """A comparison with its numbers: IoU with the paired interval, or milliseconds with the range over pairs."""

    check: Check
    verdict: Verdict
    difference: Estimate
    windows: int
    missing: tuple[str, ...] = ()  # what it needs, where it has no number
    rows: tuple[int, ...] = ()  # numbers of the rows that are compared, where it has one


@dataclass(frozen=True)
class Finding:
    """A claim with the outcomes of its comparisons, in the run of that tag."""

    run: str
    claim: Claim
    outcomes: tuple[Outcome, ...]

    @property
    def verdict(self) -> Verdict:
        """A claim fails with any of its comparisons, and holds with all of them."""
        found = {outcome.verdict for outcome in self.outcomes}
        return next(v for v in (Verdict.FAILS, Verdict.NOT_RUN, Verdict.OPEN, Verdict.HOLDS) if v in found)

    @property
    def missing(self) -> tuple[str, ...]:
        """What would have to be run for the claim to be tested."""
        return tuple(dict.fromkeys(name for outcome in self.outcomes for name in outcome.missing))


def find(runs: Sequence[Run], scores: Scores, regions: Mapping[str, Scores]) -> list[Finding]:
    """Test every claim on every run, from the scores of all cells and of those near moving and standing actors.

    They are about the paper's classes: runs of others have no findings.
    """
    found = []
    for run in filter(has_papers_classes, runs):
        places = {  # rows by their names in the matrix, which the claims go by
            region: {entry.row.record.name: entry for entry in of.values() if entry.row.run == run.folder}
            for region, of in {"": scores, **regions}.items()
        }
        for claim in claims(places[""]):
            found.append(Finding(run.tag, claim, tuple(_outcome(check, places) for check in claim.checks)))
    return found


def judge(rule: Rule, difference: Estimate) -> Verdict:
    """Apply a rule to the interval of a difference; without an interval nothing is decided."""
    low, high = difference.low, difference.high
    holds, fails = {
        "better": (low > 0, high < 0),
        "slower": (low > 0, high < 0),
        "close": (low > -MARGIN and high < MARGIN, low > MARGIN or high < -MARGIN),
        "at least": (low > -MARGIN, high < -MARGIN),
    }[rule]
    return Verdict.HOLDS if holds else Verdict.FAILS if fails else Verdict.OPEN


def sentence(findings: Sequence[Finding]) -> str:
    """Count the verdicts in words."""
    if not findings:
        return "The paper's claims and values are about its own classes; these rows have others, so none is shown."
    count = {kind: sum(each.verdict is kind for each in findings) for kind in Verdict}
    tested = len(findings) - count[Verdict.NOT_RUN]
    if not tested:
        return f"This run lacks the rows to test any of the {plural(len(findings), 'claim')}."
    one = {Verdict.HOLDS: "holds", Verdict.FAILS: "does not", Verdict.OPEN: "is undecided"}
    many = {Verdict.HOLDS: "hold", Verdict.FAILS: "do not", Verdict.OPEN: "are undecided"}
    parts = ", ".join(f"{count[kind]} {(one if count[kind] == 1 else many)[kind]}" for kind in one)
    listed = plural(len(findings), "claim")
    return f"Of {listed}, the paper's and ours about stronger baselines, {tested} can be tested here: {parts}."


def finding_table(name: str, findings: Sequence[Finding]) -> Table:
    """Show the claims that were tested, each above the comparisons behind it."""
    bodies = tuple(
        (_claim(each), *map(_line, each.outcomes)) for each in findings if each.verdict is not Verdict.NOT_RUN
    )
    columns = (("Verdict", ""), ("Score", ""), ("Difference", "95% interval"))
    caption = f"The paper's claims, the same against stronger baselines, and the residual network's{_tag(findings)}."
    return Table(name, caption, "Claim", columns, bodies)


def missing_table(name: str, findings: Sequence[Finding]) -> Table:
    """Show the claims that were not tested, and what they need."""
    untested = (each for each in findings if each.verdict is Verdict.NOT_RUN)
    lines = [Line(each.claim.text, (Cell(", ".join(each.missing)),)) for each in untested]
    caption = f"Claims that were not run, and the rows or logs that they need{_tag(findings)}."
    return plain_table(name, caption, "Claim", ("Needs",), lines)


def finding_frame(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return one line for each comparison, with the verdict of its claim beside its own."""
    lines = [_head(each) | part for each in findings for part in map(_values, each.outcomes)]
    return pd.DataFrame(lines, columns=list(FINDING_COLUMNS))


def finding_records(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Return the findings for machines; absent numbers are null."""
    return [_head(each) | {"checks": list(map(_values, each.outcomes))} for each in findings]


def _head(finding: Finding) -> dict[str, Any]:
    claim = finding.claim
    return {"run": finding.run, "name": claim.name, "claim": claim.text, "verdict": str(finding.verdict)}


def _tag(findings: Sequence[Finding]) -> str:
    return next((f" ({each.run})" for each in findings if each.run), "")


def _outcome(check: Check, places: Mapping[str, Scores]) -> Outcome:
    rows = places.get(check.region, {})
    if missing := _missing(check, places[""], rows):
        return Outcome(check, Verdict.NOT_RUN, Estimate(np.nan, np.nan, np.nan), 0, missing)
    if check.score == WINDOW_MS:
        difference = _time_difference(check, rows)
    else:
        difference = weighted_sum([(weight, rows[name]) for name, weight in check.weights.items()], check.score)
    windows = min(rows[name].windows for name in check.weights)
    numbers = tuple(rows[name].row.number for name in check.weights)
    return Outcome(check, judge(check.rule, difference), difference, windows, rows=numbers)


def _missing(check: Check, scored: Scores, near: Scores) -> tuple[str, ...]:
    """Name what a comparison lacks: rows, the truth about actors, or equal targets."""
    if missing := tuple(name for name in check.weights if name not in scored):
        return missing
    if any(name not in near for name in check.weights):
        return (TRUTH,)
    return () if len({scored[name].row.targets for name in check.weights}) == 1 else (SAME_TARGETS,)


def _time_difference(check: Check, rows: Scores) -> Estimate:
    """Take the mean over pairs of rows, and the range of the pairs in place of an interval."""
    gaps = [float(np.mean(rows[a].row.window_ms) - np.mean(rows[b].row.window_ms)) for a, b in check.pairs]
    several = len(gaps) > 1
    return Estimate(float(np.mean(gaps)), min(gaps) if several else np.nan, max(gaps) if several else np.nan)


def _claim(finding: Finding) -> Line:
    rows = dict.fromkeys(number for outcome in finding.outcomes for number in outcome.rows)
    return Line(finding.claim.text, (_verdict_cell(finding.verdict), Cell(""), Cell("")), rows=tuple(rows))


def _line(outcome: Outcome) -> Line:
    check, difference = outcome.check, outcome.difference
    if outcome.missing:
        label, number = f"needs {', '.join(outcome.missing)}", Cell(ABSENT)
    elif check.score == WINDOW_MS:
        label, number = "ms a window", _time_cell(difference)
    else:
        label = IOU.labels[check.score] + (f", {check.region}" if check.region else "")
        title = f"{interval_phrase(difference, with_sign=True)}; {plural(outcome.windows, 'window')}"
        number = difference_cell(difference, title=title)
    return Line(check.text, (_verdict_cell(outcome.verdict), Cell(label), number), "part")


def _time_cell(difference: Estimate) -> Cell:
    note = f"range {difference.low:+.1f} to {difference.high:+.1f}" if np.isfinite(difference.low) else "one pair only"
    return Cell(f"{difference.value:+.1f}", difference.value, note)


def _verdict_cell(found: Verdict) -> Cell:
    return Cell(str(found), tone={Verdict.HOLDS: "holds", Verdict.FAILS: "fails"}.get(found, ""))


def _values(outcome: Outcome) -> dict[str, Any]:
    check, difference = outcome.check, outcome.difference
    return {
        "comparison": check.text.replace(MINUS, "-"),
        "score": check.score,
        "region": check.region or "all",
        "rule": check.rule,
        "margin": MARGIN if check.rule in ("close", "at least") else 0.0,
        "comparison_verdict": str(outcome.verdict),
        "difference": finite(difference.value),
        "low": finite(difference.low),
        "high": finite(difference.high),
        "windows": outcome.windows,
        "missing": ", ".join(outcome.missing),
    }
