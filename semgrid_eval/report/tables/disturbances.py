"""What each model loses where its inputs are disturbed: its disturbed rows against the undisturbed one."""

from collections.abc import Sequence

from semgrid_eval.report.estimates.bootstrap import RowScores, Scores, shared_iou
from semgrid_eval.report.rows.load import Row, comparable
from semgrid_eval.report.rows.pairing import settings_of
from semgrid_eval.report.tables.numbers import interval_phrase
from semgrid_eval.report.tables.table import Cell, Line, Table, difference_cell, value_cell
from semgrid_eval.report.tables.values import evidence
from semgrid_eval.words import plural

_CAPTION = (
    "What disturbed inputs cost: the score of each model with its inputs as they are, and below it what it loses where "
    "they are wrong (difference with the paired interval). Training, targets and mask M are the same."
)


def disturbance_table(scores: Scores) -> Table | None:
    """Show a card for each undisturbed row that has disturbed ones beside it; None where there is none."""
    disturbed: dict[str, list[RowScores]] = {}
    for entry in scores.values():
        if entry.row.disturbed and (base := undisturbed(entry.row, [other.row for other in scores.values()])):
            disturbed.setdefault(base.name, []).append(entry)
    cards = tuple(_card(scores[name], entries) for name, entries in disturbed.items())
    iou = shared_iou(scores.values())
    columns = tuple((iou.labels[column], "") for column in iou.compared)
    return Table("disturbances", _CAPTION, "Inputs", columns, cards) if cards else None


def undisturbed(row: Row, rows: Sequence[Row]) -> Row | None:
    """Find the row of the same run that differs in nothing but that its inputs are right, None where there is none."""
    settings = _settings_but_disturbance(row)
    alike = (other for other in rows if not other.disturbed and other.run == row.run and comparable(row, other))
    return next((other for other in alike if _settings_but_disturbance(other) == settings), None)


def _settings_but_disturbance(row: Row) -> dict[str, object]:
    return {key: value for key, value in settings_of(row).items() if key.partition(".")[0] != "disturb"}


def _card(base: RowScores, entries: Sequence[RowScores]) -> tuple[Line, ...]:
    values = tuple(value_cell(base.estimate(name), title=evidence(base, name)) for name in shared_iou([base]).compared)
    head = Line(base.row.name, values, title=base.row.record.label, rows=(base.row.number,))
    return (
        head,
        *(Line(entry.row.disturbed, _losses(entry, base), "part", entry.row.record.label) for entry in entries),
    )


def _losses(entry: RowScores, base: RowScores) -> tuple[Cell, ...]:
    found = []
    for column in shared_iou([base]).compared:
        difference = entry.minus(base, column)
        behind = f"{plural(entry.row.windows, 'window')}; {interval_phrase(difference, with_sign=True)}"
        found.append(difference_cell(difference, title=f"{evidence(entry, column)}; {behind}"))
    return tuple(found)
