"""What each row of a matrix changes against the row it is closest to, and what the change does to its score."""

from collections.abc import Mapping, Sequence
from typing import Any

from semgrid_eval.report.cells import Cell, Line, Table, difference_cell, interval_phrase
from semgrid_eval.report.comparison import HEADLINE, verdict
from semgrid_eval.report.estimates import RowScores

Scores = Mapping[str, RowScores]

_UNSET = "not set"


def changes_table(scores: Scores) -> Table | None:
    """Show, for each row, the settings it changes against its model's DC row, and the difference of the mean score."""
    entries, bodies = list(scores.values()), []
    for entry in entries:
        base = _base_of(entry, entries)
        changed = changed_settings(_config(base), _config(entry))
        if entry is base or not changed:
            continue
        difference = entry.minus(base, HEADLINE)
        title = interval_phrase(difference, with_sign=True)
        cells = (Cell("; ".join(changed)), difference_cell(difference, verdict(difference), title=title))
        bodies.append((Line(f"{entry.row.name} \N{MINUS SIGN} {base.row.name}", cells),))
    caption = "What each row changes against the first row of its model (DC where there is one), and what that does."
    columns = (("Settings", ""), ("Mean (known)", ""))
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


def _base_of(entry: RowScores, entries: Sequence[RowScores]) -> RowScores:
    mine = entry.row
    alike = [e for e in entries if e.row.record.model == mine.record.model and e.row.run == mine.run]
    return next((e for e in alike if e.row.record.experiment == "DC"), alike[0])


def _config(entry: RowScores) -> Mapping[str, object]:
    return entry.row.results[0].record.config


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(part) for part in value)
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
