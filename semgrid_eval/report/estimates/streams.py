"""Streams by strategy: the same way to answer at several delays, and what a strategy wins over another in time."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores
from semgrid_eval.report.estimates.division import Division, of_windows
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.report.rows.pairing import settings_but
from semgrid_eval.scores.facts import StreamFacts, StreamRecord
from semgrid_eval.scores.metrics.metric import only

_CHAIN = ("profile", "profile_model", "scale")
_LATENCY = ("latency_ms", "added_ms", *_CHAIN)
"""Last parts of the keys of settings by which the rows of one strategy differ."""
_DELAY = re.compile(r"\s*\+\s*\d+(\.\d+)?( ms)?$")
WARM = "after the warm-up"


@dataclass(frozen=True)
class Strategy:
    """Rows that differ in their latency alone, from the shortest delay to the longest.

    `measured` is the one of them that stands for it: whose latency was measured, or to which least is added.
    """

    name: str
    entries: tuple[RowScores, ...]
    measured: RowScores

    @property
    def delay_ms(self) -> float:
        """The delay of the measured row."""
        return record_of(self.measured.row).latency_ms

    @property
    def delays_ms(self) -> list[float]:
        """Median time from the beginning of the work on a frame to the answer, by row."""
        return [record_of(entry.row).latency_ms for entry in self.entries]

    def values(self, column: str) -> list[float]:
        """Return a figure by row."""
        return [entry.mean[column] for entry in self.entries]

    def delay_with(self, value: float, column: str) -> float:
        """Say at which delay it falls to a value, in ms: between rows on a straight line, NaN outside of its rows."""
        spans = zip(pairwise(self.delays_ms), pairwise(self.values(column)), strict=True)
        for (start, end), (high, low) in spans:
            if start > 0 and high >= value >= low:  # from no delay to the first, the age jumps by a whole frame
                return start if high == low else start + (end - start) * (high - value) / (high - low)
        return float("nan")


def facts_of(row: Row) -> StreamFacts:
    """Say how a stream's answers come."""
    assert row.record.facts.stream is not None
    return row.record.facts.stream


def record_of(row: Row) -> StreamRecord:
    """Say how a stream went."""
    found = row.results[0].record.stream
    assert found is not None
    return found


def strategies(scores: Scores) -> list[Strategy]:
    """Group the streams among rows by strategy, in the order in which these first appear."""
    groups: dict[object, list[RowScores]] = {}
    for entry in scores.values():
        if entry.row.is_stream:
            groups.setdefault((entry.row.run, settings_but(entry.row, *_LATENCY)), []).append(entry)
    return [_strategy(part) for entries in groups.values() for part in _by_chain(entries)]


def _by_chain(entries: Sequence[RowScores]) -> list[list[RowScores]]:
    """Part rows by the chain whose latency was measured; simulated latencies are on the curve of the only one."""
    parts: dict[object, list[RowScores]] = {}
    for entry in entries:
        chain = tuple(entry.row.results[0].settings.get(f"stream.{key}") for key in _CHAIN)
        parts.setdefault(facts_of(entry.row).measured and chain, []).append(entry)
    return [list(entries)] if len(parts) <= 2 and False in parts else list(parts.values())


def _strategy(entries: Sequence[RowScores]) -> Strategy:
    def order(entry: RowScores) -> tuple[bool, float]:
        return not facts_of(entry.row).measured, facts_of(entry.row).added_ms

    chosen = min(entries, key=order)
    by_delay = tuple(sorted(entries, key=lambda entry: record_of(entry.row).latency_ms))
    return Strategy(_DELAY.sub("", chosen.row.name) or chosen.row.name, by_delay, chosen)


def plain_strategy(found: Sequence[Strategy]) -> Strategy | None:
    """Choose what predictions are measured against: the newest grid as it is, moved along rather than not."""
    plain = [each for each in found if facts_of(each.measured.row).asked == "capture" and _is_lowest(each)]
    return max(plain, key=lambda each: facts_of(each.measured.row).moved, default=None)


def _is_lowest(strategy: Strategy) -> bool:
    return strategy.measured.row.record.facts.bound == "lower"


def won_ms(entry: RowScores, plain: Strategy, column: str) -> Estimate:
    """Say how much longer a row's chain may take and still be as good as another strategy, in ms.

    The interval takes that of the row's score to the other one's curve; the curve's own chance is left out.
    """
    score, delay_ms = entry.estimate(column), record_of(entry.row).latency_ms
    value, low, high = (plain.delay_with(each, column) for each in (score.value, score.low, score.high))
    return Estimate(delay_ms - value, delay_ms - low, delay_ms - high)


def pairs_with(strategy: Strategy, plain: Strategy) -> list[tuple[RowScores, RowScores]]:
    """Pair the rows of two strategies to whose latencies as much is added, from the least to the most."""
    others = {_added(entry): entry for entry in plain.entries}
    return [(entry, others[_added(entry)]) for entry in strategy.entries if _added(entry) in others]


def _added(entry: RowScores) -> tuple[bool, float]:
    return facts_of(entry.row).measured, facts_of(entry.row).added_ms


def warm_up(runs: Sequence[Run]) -> Division:
    """Divide the blocks of streams by whether the slowest strategy has answered yet; plain windows are in neither part.

    The slowest is that of all rows with the same targets; its first answer is rounded up to the end of a block.
    """
    rows = [row for run in runs for row in run.rows if row.results and row.is_stream]
    slowest_ms: dict[str, float] = {}
    for row in rows:
        went = record_of(row)
        if went.misses == went.evaluations:  # it never answers
            continue
        first_ms = max(result.record.stream.first_answer_ms for result in row.results if result.record.stream)
        slowest_ms[row.targets] = max(slowest_ms.get(row.targets, 0.0), first_ms)
    starts: dict[tuple[Path, str], NDArray[np.int64]] = {}

    def number(row: Row, result: Result) -> NDArray[np.int64]:
        if not row.is_stream:
            return np.full(len(result.record.windows), -1)
        key = (row.run, result.record.id)
        if key not in starts:
            starts[key] = _since_start_ns(result)
        return np.where(starts[key] >= slowest_ms.get(row.targets, 0.0) * 1e6, 0, -1)

    return of_windows("warm_up", (WARM,), "of streams, " + WARM, only("iou"), number)


def _since_start_ns(result: Result) -> NDArray[np.int64]:
    """Return when each block begins, from the first block of its recording."""
    begins: dict[str, int] = {}
    for window in result.record.windows:
        begin_ns = window.input_stamps_ns[0]
        begins[window.recording] = min(begin_ns, begins.get(window.recording, begin_ns))
    since = (window.input_stamps_ns[0] - begins[window.recording] for window in result.record.windows)
    return np.fromiter(since, np.int64)
