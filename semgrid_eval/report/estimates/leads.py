"""The lead that is best at a latency: of rows that differ in their lead alone, by category."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, fewest_units, shared_iou
from semgrid_eval.report.estimates.intervals import Estimate, intervals_of, stretched
from semgrid_eval.report.estimates.streams import facts_of
from semgrid_eval.report.rows.pairing import settings_but


@dataclass(frozen=True)
class LeadSeries:
    """Streams that differ in their lead alone, from the shortest to the longest."""

    entries: tuple[RowScores, ...]

    @property
    def leads_ms(self) -> list[float]:
        """The leads."""
        return [lead_of(entry) for entry in self.entries]

    def best(self, column: str) -> tuple[RowScores, Estimate]:
        """Return the row with the highest value, and its lead in ms; the interval is that of the best lead by draw."""
        values = np.array([entry.mean[column] for entry in self.entries])
        chosen = self.entries[int(np.nanargmax(values))] if np.isfinite(values).any() else self.entries[0]
        draws = np.hstack([entry.draws_of([column]) for entry in self.entries])  # (B, L)
        units = fewest_units(self.entries, [column]).repeat(len(self.entries))
        likely = stretched(draws, units)
        leads_ms = np.array(self.leads_ms)[np.nan_to_num(likely, nan=-np.inf).argmax(axis=1)]
        known = np.isfinite(likely).any(axis=1)
        return chosen, intervals_of([lead_of(chosen)], leads_ms[known, None])[0]


def lead_of(entry: RowScores) -> float:
    """Return the lead of a row in ms."""
    lead_ms = entry.row.record.facts.lead_ms
    assert lead_ms is not None
    return lead_ms


def lead_series(scores: Scores) -> list[LeadSeries]:
    """Group streams by all but their lead, those whose latency was measured first; groups of one lead are left out."""
    groups: dict[object, list[RowScores]] = {}
    for entry in scores.values():
        facts = entry.row.record.facts
        if facts.stream is not None and facts.stream.asked == "fixed" and facts.lead_ms is not None:
            groups.setdefault((entry.row.run, settings_but(entry.row, "lead_ms")), []).append(entry)
    found = [LeadSeries(tuple(sorted(each, key=lead_of))) for each in groups.values() if len(each) > 1]
    return sorted(found, key=lambda series: not facts_of(series.entries[0].row).measured)


def best_leads(found: Sequence[LeadSeries]) -> dict[str, float]:
    """Return the best lead in ms of the first series, for each category that has values; nothing without a series."""
    best = {column: found[0].best(column) for column in shared_iou(found[0].entries).compared} if found else {}
    return {column: lead.value for column, (entry, lead) in best.items() if np.isfinite(entry.mean[column])}
