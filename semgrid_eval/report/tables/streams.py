"""Tables of streams: every strategy at the latency that was measured, and what predictions win over the newest grid."""

import math
from collections.abc import Iterator, Sequence

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, shared_iou
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.estimates.leads import LeadSeries
from semgrid_eval.report.estimates.streams import Strategy, facts_of, pairs_with, plain_strategy, record_of, won_ms
from semgrid_eval.report.rows.pairing import HEADLINE, VERDICTS, verdict
from semgrid_eval.report.tables.numbers import ABSENT, MINUS, finite, interval_phrase, number, signed
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, value_cell
from semgrid_eval.report.tables.values import evidence

_MOVING = 2  # figures of what moves that are shown
_STREAMS = (
    "Streaming IoU: at each time of evaluation, the newest grid that was published by then against what is measured at "
    "that time; with 95% interval. Latency: from the beginning of the work on a frame to its answer, median. Age: from "
    "the capture of the newest input to the time of evaluation, median (99th percentile). Lead: how far after that "
    "capture the grid is for. Misses: times of evaluation before the first answer, at which all is unknown."
)
_LEADS = (
    "The lead, from the capture of the newest input to the time that a grid is for, of the highest streaming IoU, and "
    "the interval of the lead that is best in a resample; the score stands in the tooltip. Read from leads.json by a "
    "row's lead_ms: from REPORT/leads.json."
)
_WINS = (
    "What each strategy wins over {plain} with as much added to its latency: paired differences of streaming IoU, and "
    "how many ms longer than that of {plain} its chain may take and still give the same mean. Misses before the first "
    "answer count."
)


def stream_table(found: Sequence[Strategy], warm: Scores, moving: Scores) -> Table | None:
    """Show every strategy at its least delay; None where there is no stream."""
    if not found:
        return None
    iou = shared_iou(each.measured for each in found)
    columns = [(iou.labels[column], "") for column in iou.compared]
    columns += [("Mean", "after the warm-up")]
    columns += [(iou.labels[column], "near moving actors") for column in iou.moving[:_MOVING]]
    columns += [("Latency", "ms"), ("Age", "ms"), ("Lead", "ms"), ("Misses", "")]
    return Table("streams", _STREAMS, "Strategy", tuple(columns), tuple((_line(each, warm, moving),) for each in found))


def _line(strategy: Strategy, warm: Scores, moving: Scores) -> Line:
    entry, record = strategy.measured, record_of(strategy.measured.row)
    iou = shared_iou([entry])
    cells = [_value(entry, column) for column in iou.compared]
    cells += [_found(warm, entry, HEADLINE), *(_found(moving, entry, column) for column in iou.moving[:_MOVING])]
    cells += [_ms(record.latency_ms), _ms(record.age_ms, f"{record.oldest_ms:.0f}"), _ms(record.lead_ms)]
    share = record.misses / max(1, record.evaluations)
    cells.append(Cell(f"{share:.1%}", share, f"of {record.evaluations:,}", f"{record.misses:,} without an answer"))
    kind = "truth" if entry.row.uses_truth else ""
    return Line(strategy.name, tuple(cells), kind, entry.row.record.label, (entry.row.number,))


def _value(entry: RowScores, column: str) -> Cell:
    return value_cell(entry.estimate(column), title=evidence(entry, column))


def _found(scores: Scores, entry: RowScores, column: str) -> Cell:
    other = scores.get(entry.row.name)
    return Cell(ABSENT) if other is None else _value(other, column)


def _ms(value: float, note: str = "") -> Cell:
    return Cell(f"{value:.0f}", value, note)


def wins_table(found: Sequence[Strategy]) -> Table | None:
    """Show what strategies win over the newest grid as it is; None where there is nothing to measure by."""
    plain = plain_strategy(found)
    if plain is None:
        return None
    bodies = [tuple(_wins(each, plain)) for each in found if each is not plain and _same(each, plain)]
    iou = shared_iou([plain.measured])
    columns = tuple([(iou.labels[column], "") for column in iou.compared] + [("Won", "ms")])
    caption = _WINS.replace("{plain}", plain.name)
    lines = tuple(body for body in bodies if body)
    return Table("stream-wins", caption, f"Strategies less {plain.name}", columns, lines) if lines else None


def _same(strategy: Strategy, other: Strategy) -> bool:
    mine, theirs = strategy.measured, other.measured
    return mine.row.run == theirs.row.run and mine.cells_key[0] == theirs.cells_key[0]


def _wins(strategy: Strategy, plain: Strategy) -> Iterator[Line]:
    """Compare delay by delay: the first line is the strategy's, the others belong to it."""
    for place, (entry, other) in enumerate(pairs_with(strategy, plain)):
        cells = []
        for column in shared_iou([entry]).compared:
            difference = entry.minus(other, column)
            title = f"{evidence(entry, column)}; difference: {interval_phrase(difference, with_sign=True)}"
            cells.append(difference_cell(difference, title=title))
        cells.append(_won(won_ms(entry, plain, HEADLINE)))
        added_ms = facts_of(entry.row).added_ms
        added = f"+{added_ms:g} ms" if added_ms else ""
        kind = "part" if place else "truth" if entry.row.uses_truth else ""
        header = added if place else f"{strategy.name} {added}".rstrip()
        yield Line(header, tuple(cells), kind, entry.row.record.label, (strategy.measured.row.number,))


def _won(won: Estimate) -> Cell:
    if not math.isfinite(won.value):
        return Cell(ABSENT, title="its score lies outside of those of the curve")
    ends = (won.low, won.high) if math.isfinite(won.low) and math.isfinite(won.high) else None
    note = " to ".join(map(_whole, ends)) if ends else ""
    return Cell(_whole(won.value), finite(won.value), note, tone=verdict(won), interval=ends)


def _whole(value_ms: float) -> str:
    return f"{value_ms:+.0f}".replace("-", MINUS)


def lead_table(found: Sequence[LeadSeries]) -> Table | None:
    """Show the best lead of each series by category; None where there is none."""
    iou = shared_iou(entry for series in found for entry in series.entries)
    columns = tuple((iou.labels[column], "ms") for column in iou.compared)
    lines = tuple((_best_leads(series),) for series in found)
    return Table("stream-leads", _LEADS, "Streams", columns, lines) if lines else None


def _best_leads(series: LeadSeries) -> Line:
    cells = []
    for column in shared_iou(series.entries).compared:
        entry, lead = series.best(column)
        note = f"{lead.low:.0f} to {lead.high:.0f}" if math.isfinite(lead.low) else ""
        cells.append(Cell(f"{lead.value:.0f}", finite(lead.value), note, evidence(entry, column)))
    first, last = series.entries[0], series.entries[-1]
    return Line(f"{first.row.name} to {last.row.name}", tuple(cells), "", first.row.record.label, (first.row.number,))


def stream_sentence(found: Sequence[Strategy]) -> str:
    """Say what prediction is worth at the measured latency; empty where nothing can be compared."""
    plain = plain_strategy(found)
    predicted = [
        each
        for each in found
        if plain and each is not plain and _same(each, plain) and not each.measured.row.uses_truth and _predicts(each)
    ]
    if plain is None or not predicted:
        return ""
    best = max(predicted, key=lambda each: each.measured.mean[HEADLINE])
    gain, won = best.measured.minus(plain.measured, HEADLINE), won_ms(best.measured, plain, HEADLINE)
    first = (
        f"{best.name}, whose chain takes {best.delay_ms:.0f} ms, has a mean streaming IoU of "
        f"{number(best.measured.mean[HEADLINE])}; {plain.name}, with {plain.delay_ms:.0f} ms, "
        f"{number(plain.measured.mean[HEADLINE])}: {signed(gain.value)}, {VERDICTS[verdict(gain)]} "
        f"({interval_phrase(gain, with_sign=True)})"
    )
    if not math.isfinite(won.value):
        return f"{first}."
    as_late = best.delay_ms - won.value
    return f"{first}. {plain.name} would be as good with {as_late:.0f} ms."


def _predicts(strategy: Strategy) -> bool:
    """Tell whether it is a prediction that anybody could make, with a lead that was not chosen on what is scored."""
    row = strategy.measured.row
    asked, lead_ms = facts_of(row).asked, row.record.facts.lead_ms
    return not row.is_oracle and (asked == "adaptive" or (asked == "fixed" and lead_ms is None))
