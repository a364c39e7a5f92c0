"""The lead that is best at a latency: of rows that differ in their lead alone, by category."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semgrid_eval.report.estimates.bootstrap import (
    Estimate,
    RowScores,
    Scores,
    fewest_units,
    interval_of,
    shared_iou,
    stretched,
)
from semgrid_eval.report.estimates.streams import facts_of
from semgrid_eval.report.rows.pairing import settings_but
from semgrid_eval.scores.metrics.metric import column_names


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
        at = column_names(self.entries[0].metric).index(column)
        units = fewest_units(self.entries, column)
        draws = np.stack([stretched(entry.draws[:, at], units) for entry in self.entries])  # (L, B)
        chosen = self.entries[int(np.nanargmax(values))] if np.isfinite(values).any() else self.entries[0]
        return chosen, interval_of(
            lead_of(chosen), np.array(self.leads_ms)[np.nan_to_num(draws, nan=-np.inf).argmax(axis=0)]
        )


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
