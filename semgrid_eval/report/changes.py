"""What each row of a matrix changes against the row it is closest to, and what the change does to its score."""

from collections.abc import Mapping, Sequence
from typing import Any

from semgrid_eval.report.cells import Cell, Line, Table, difference_cell, interval_phrase, plural
from semgrid_eval.report.comparison import DIFFERENCE_COLUMNS, verdict
from semgrid_eval.report.estimates import RowScores
from semgrid_eval.report.tables import LABELS

Scores = Mapping[str, RowScores]

_UNSET = "not set"


def changes_table(scores: Scores) -> Table | None:
    """Show what each row changes against the row of its model that it is closest to, and what that does to scores."""
    entries, bodies = list(scores.values()), []
    for entry in entries:
        base = _base_of(entry, entries)
        if base is None:
            continue
        changed = changed_settings(_config(base), _config(entry))
        cells = (Cell("; ".join(changed)), *(_difference(entry, base, column) for column in DIFFERENCE_COLUMNS))
        bodies.append((Line(f"{entry.row.name} \N{MINUS SIGN} {base.row.name}", cells),))
    caption = "What each row changes against the row of its model that it is closest to, and what that does to scores."
    columns = (("Settings", ""), *((LABELS[column], "") for column in DIFFERENCE_COLUMNS))
    return Table("changes", caption, "Rows", columns, tuple(bodies)) if bodies else None


def changed_settings(before: Mapping[str, object], after: Mapping[str, object]) -> list[str]:
    """List the settings that differ, nested ones with dots: `network.depth 3 to 4`."""
    old, new = flat(before), flat(after)
    keys = [*old, *(key for key in new if key not in old)]
    pairs = [(key, old.get(key, _UNSET), new.get(key, _UNSET)) for key in keys]
    return [f"{key} {_text(first)} to {_text(second)}" for key, first, second in pairs if first != second]


def flat(config: Mapping[str, object], prefix: str = "") -> dict[str, Any]:
    """Flatten nested settings to dotted names."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found


def _base_of(entry: RowScores, entries: Sequence[RowScores]) -> RowScores | None:
    """Choose, of the rows above it and the DC row of its model and run, the one with the fewest other settings.

    None where there is no such row, or one that differs in nothing.
    """
    mine, at = entry.row, next(i for i, other in enumerate(entries) if other is entry)
    choices = [other for i, other in enumerate(entries) if i < at or (i > at and other.row.record.experiment == "DC")]
    alike = [each for each in choices if (each.row.record.model, each.row.run) == (mine.record.model, mine.run)]
    counts = [(len(changed_settings(_config(other), _config(entry))), other) for other in alike]
    count, base = min(counts, key=lambda pair: pair[0], default=(0, None))
    return base if count else None


def _difference(entry: RowScores, base: RowScores, column: str) -> Cell:
    difference = entry.minus(base, column)
    title = f"{plural(entry.row.windows, 'window')}; {plural(len(entry.row.results), 'result')}"
    title += f"; {interval_phrase(difference, with_sign=True)}"
    return difference_cell(difference, verdict(difference), title=title)


def _config(entry: RowScores) -> Mapping[str, object]:
    return entry.row.results[0].record.config


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(part) for part in value)
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
