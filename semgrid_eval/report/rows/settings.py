"""How the settings of rows differ: which keys, and which rows are alike but for some of them."""

from collections.abc import Mapping

from semgrid_eval.report.rows.load import Row

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
