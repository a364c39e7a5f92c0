"""How the settings of rows differ: which keys, and which rows are alike but for some of them."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import HEADLINE

_UNSET = "not set"
_OF_TARGETS = ("grid.", "window.", "validation_window", "validation_split", "mask_mode")


def settings_of(row: Row) -> Mapping[str, object]:
    """Return all that determined a row's numbers, nested settings under dotted names."""
    return row.results[0].settings


def changed_settings(before: Mapping[str, object], after: Mapping[str, object]) -> dict[str, str]:
    """Say in words which flat settings differ, by key: `mask_mode exclude to off`."""
    keys = [*before, *(key for key in after if key not in before)]
    pairs = [(key, before.get(key, _UNSET), after.get(key, _UNSET)) for key in keys]
    return {key: f"{key} {_text(first)} to {_text(second)}" for key, first, second in pairs if first != second}


def changed_targets(before: Mapping[str, object], after: Mapping[str, object]) -> list[str]:
    """Say which of the settings that differ decide what the targets are."""
    return [text for key, text in changed_settings(before, after).items() if key.startswith(_OF_TARGETS)]


def settings_but(row: Row, *left_out: str) -> tuple[tuple[str, str], ...]:
    """Return a row's settings, to compare and to group by, without those whose last part is `left_out`."""
    kept = {key: value for key, value in settings_of(row).items() if key.rpartition(".")[2] not in left_out}
    return tuple(sorted((key, repr(value)) for key, value in kept.items()))


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(str(part) for part in value)
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


_MOST_SETS = 4
_LEFT_OUT = "horizon_steps"  # scores over the lead time have a figure of their own
Keys = tuple[str, ...]


@dataclass(frozen=True)
class Varied:
    """Rows that differ in the numeric settings `keys` alone, the first of which is drawn along the axis."""

    keys: Keys
    rows: tuple[RowScores, ...]

    def value(self, entry: RowScores, at: int = 0) -> Any:  # noqa: ANN401 - whichever number a setting is
        """Return a row's value of a setting; nothing where there is only one setting."""
        return settings_of(entry.row)[self.keys[at]] if at < len(self.keys) else None

    @property
    def reach(self) -> float:
        """From the smallest to the largest value of the first setting."""
        return float(np.ptp([self.value(entry) for entry in self.rows]))

    def lines(self) -> list[list[RowScores]]:
        """Return the rows of each value of the second setting, ordered by the first."""
        lines: dict[Any, list[RowScores]] = {}
        for entry in sorted(self.rows, key=lambda entry: (self.value(entry, 1) or 0, self.value(entry))):
            lines.setdefault(self.value(entry, 1), []).append(entry)
        return list(lines.values())


def varied_settings(scores: Scores) -> list[Varied]:
    """Find the sets of rows of one model, run and targets that differ in one or two numeric settings, largest first."""
    models: dict[object, list[RowScores]] = {}
    for entry in scores.values():
        if np.isfinite(entry.mean[HEADLINE]):
            key = (entry.row.run, entry.row.targets, entry.row.record.facts.model)
            models.setdefault(key, []).append(entry)
    sets = [each for entries in models.values() for each in _sets(entries)]
    found: list[Varied] = []
    for each in sorted(sets, key=lambda each: (-len(each.rows), len(each.keys))):
        drawn = {entry.row.name for other in found for entry in other.rows}
        if sum(entry.row.name not in drawn for entry in each.rows) > 1:
            found.append(each)
    return found[:_MOST_SETS]


def _sets(entries: Sequence[RowScores]) -> Iterator[Varied]:
    """Group the rows of a model by all settings but one or two that vary."""
    flat = {entry.row.name: dict(settings_of(entry.row)) for entry in entries}
    numeric = _varying(list(flat.values()))
    for keys in (*((key,) for key in numeric), *itertools.combinations(numeric, 2)):
        groups: dict[str, dict[Any, RowScores]] = {}
        for entry in entries:
            mine = flat[entry.row.name]
            rest = repr(sorted((key, repr(value)) for key, value in mine.items() if key not in keys))
            # Rows that mean the same are one point.
            groups.setdefault(rest, {}).setdefault(tuple(mine.get(key) for key in keys), entry)
        for group in groups.values():
            distinct = [len(set(values)) for values in zip(*group, strict=True)]
            # Points differ in each setting, and some of them in one setting only.
            if min(distinct) > 1 and (len(distinct) == 1 or len(group) > max(distinct)):
                along = keys if distinct[0] == max(distinct) else keys[::-1]
                yield Varied(along, tuple(group.values()))


def _varying(settings: Sequence[dict[str, object]]) -> list[str]:
    """List the settings that are numbers in all rows, and not the same in all."""
    return [
        key
        for key in settings[0]
        if not key.endswith(_LEFT_OUT)
        and all(isinstance(each.get(key), int | float) and not isinstance(each[key], bool) for each in settings)
        and len({each[key] for each in settings}) > 1
    ]
