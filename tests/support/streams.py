"""Rows with a stream, in memory."""

from dataclasses import replace

from support.fake_run import counted_row

from semgrid_eval.scores.facts import StreamFacts, StreamRecord


def stream(
    name, hits, *, delay, asked="capture", measured=False, moved=True, free=False, first=0.0, lead_ms=None, **chain
):
    """A row with a stream that has as many hits of road and car in each of its recordings."""
    values = hits if isinstance(hits, list) else [hits] * 12
    made = counted_row(name, {"road": values, "car": values})
    how = StreamFacts(
        words="moved along" if moved else "not moved",
        added_ms=0.0 if measured else delay,
        measured=measured,
        moved=moved,
        asked=asked,
        model_is_free=free,
    )
    bound = "lower" if asked == "capture" else ""
    facts = made.record.facts.model_copy(update={"stream": how, "bound": bound, "lead_ms": lead_ms})
    went = StreamRecord(
        evaluations=40,
        misses=1,
        answers=20,
        first_answer_ms=first,
        age_ms=delay,
        oldest_ms=delay,
        latency_ms=delay,
        lead_ms=lead_ms or 0.0,
    )
    settings = {
        "asked": asked,
        "move": moved,
        "free": free,
        "stream": {"added_ms": delay, **chain},
        "window": {"lead_ms": lead_ms},
    }
    record = made.results[0].record.model_copy(update={"facts": facts, "stream": went, "config": settings})
    result = replace(made.results[0], record=record)
    return replace(made, record=made.record.model_copy(update={"facts": facts}), results=(result,))
