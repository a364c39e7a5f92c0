"""What each row of a matrix changes against the row it is closest to, and what the change does to its score."""

from collections.abc import Mapping, Sequence

from semgrid_eval.report.estimates.bootstrap import LABELS, RowScores, Scores
from semgrid_eval.report.rows.pairing import DIFFERENCE_COLUMNS
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, interval_phrase, plural

_UNSET = "not set"


def changes_table(scores: Scores) -> Table | None:
    """Show what each row changes against the row of its model that it is closest to, and what that does to scores."""
    entries, bodies = list(scores.values()), []
    settings = [entry.row.results[0].settings for entry in entries]
    for at, entry in enumerate(entries):
        changes = [(changed_settings(settings[i], settings[at]), entries[i]) for i in _alike(at, entries)]
        changed, base = min(changes, key=lambda change: len(change[0]), default=([], entry))
        if not changed:
            continue
        cells = (Cell("; ".join(changed)), *(_difference(entry, base, column) for column in DIFFERENCE_COLUMNS))
        bodies.append((Line(f"{entry.row.name} \N{MINUS SIGN} {base.row.name}", cells),))
    caption = "What each row changes against the row of its model that it is closest to, and what that does to scores."
    columns = (("Settings", ""), *((LABELS[column], "") for column in DIFFERENCE_COLUMNS))
    return Table("changes", caption, "Rows", columns, tuple(bodies)) if bodies else None


def changed_settings(before: Mapping[str, object], after: Mapping[str, object]) -> list[str]:
    """List which flat settings differ: `settings.depth 3 to 4`."""
    keys = [*before, *(key for key in after if key not in before)]
    pairs = [(key, before.get(key, _UNSET), after.get(key, _UNSET)) for key in keys]
    return [f"{key} {_text(first)} to {_text(second)}" for key, first, second in pairs if first != second]


def _alike(at: int, entries: Sequence[RowScores]) -> list[int]:
    """List the rows of the same model and run that may be the base of one: those above it, and the DC row."""
    mine = entries[at].row
    return [
        i
        for i, other in enumerate(entries)
        if (i < at or (i > at and other.row.record.experiment == "DC"))
        and (other.row.record.model, other.row.run) == (mine.record.model, mine.run)
    ]


def _difference(entry: RowScores, base: RowScores, column: str) -> Cell:
    difference = entry.minus(base, column)
    title = f"{plural(entry.row.windows, 'window')}; {plural(len(entry.row.results), 'result')}"
    title += f"; {interval_phrase(difference, with_sign=True)}"
    return difference_cell(difference, title=title)


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(part) for part in value)
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
