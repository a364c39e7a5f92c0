"""What rows are, in words: what their models do, and what they are asked."""

from collections.abc import Iterator, Sequence

from semgrid_eval.report.rows.load import Row


def model_words(row: Row) -> str:
    """Say what a row's model does, and where its grids are not moved as usual; runs of long ago tell its name alone."""
    facts = row.record.facts
    moved = "" if facts.translate else ", inputs not moved to the target's time"
    carried = "" if facts.stream is None or facts.stream.moved else ", answers not moved along with the vehicle"
    return f"{row.record.words or facts.model}{moved}{carried}"


def question_words(row: Row, first: Row) -> str:
    """Say what a row is asked: as far as that is not what `first` is asked, or else all of it."""
    return ", ".join(_asked(row, first)) or ", ".join(_asked(row, None))


def otherwise_asked(row: Row, first: Row) -> str:
    """Say what a row is asked that `first` is not; empty where both are asked the same."""
    return ", ".join(_asked(row, first))


def _asked(row: Row, first: Row | None) -> Iterator[str]:
    mine, theirs = row.record.facts, None if first is None else first.record.facts
    if theirs is None or mine.inputs != theirs.inputs:
        yield f"{mine.inputs} input{'' if mine.inputs == 1 else 's'}"
    if theirs is None or mine.sensors != theirs.sensors:
        yield _sensors(mine.sensors)
    if first is None or _ahead(row) != _ahead(first):
        yield _ahead(row)
    if not mine.translate and (theirs is None or theirs.translate):
        yield "inputs not moved to the target's time"
    if mine.translate and theirs is not None and not theirs.translate:
        yield "inputs moved to the target's time"
    if first is not None and row.disturbed != first.disturbed:
        yield row.disturbed or "undisturbed"
    if first is not None and row.targets != first.targets:
        yield "other targets"


def _ahead(row: Row) -> str:
    """Say how far a row looks ahead."""
    if (lead_ms := row.record.facts.lead_ms) is not None:
        return f"{lead_ms:g} ms ahead"
    return "no fixed lead" if row.is_stream else f"{row.results[0].record.lead_s:.2f} s ahead"


def _sensors(names: tuple[str, ...]) -> str:
    return f"sensor{'' if len(names) == 1 else 's'} {' + '.join(names)}"


def same_rows(rows: Sequence[Row]) -> dict[str, str]:
    """Name, for each row that is an earlier one by another name, that one: results are named by what rows are."""
    first: dict[tuple[str, ...], str] = {}
    named = [(row.name, first.setdefault(row.record.results, row.name)) for row in rows if row.record.results]
    return {name: other for name, other in named if name != other}
