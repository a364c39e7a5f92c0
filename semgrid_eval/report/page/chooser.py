"""The row chooser of a page: by what rows can be chosen, and which rows each choice stands for."""

from collections.abc import Sequence
from dataclasses import dataclass

from semgrid_eval.report.rows.load import Row, Run
from semgrid_eval.report.rows.pairing import by_question
from semgrid_eval.report.rows.words import question_words


@dataclass(frozen=True)
class Axis:
    """One thing to choose rows by: its key in the address, its name, and the numbers of rows by choice."""

    key: str
    label: str
    choices: dict[str, list[int]]


def chooser_axes(runs: Sequence[Run]) -> list[Axis]:
    """Return what rows with results can be chosen by: families, what they are asked, runs; those with no choice not."""
    rows = [row for run in runs for row in run.rows if row.results]
    first = next((row for row in rows if not row.uses_truth), None)
    families = [(row.record.facts.family, row) for row in rows]
    asked = [(question_words(row, first or row), row) for group in by_question(rows) for row in group]
    whose = [(run.tag, row) for run in runs for row in run.rows if row.results]
    axes = (
        Axis("families", "Families", _gathered(families)),
        Axis("experiments", "Experiments", _gathered(asked)),
        Axis("runs", "Runs", _gathered(whose)),
    )
    return [axis for axis in axes if len(axis.choices) > 1]


def _gathered(named: Sequence[tuple[str, Row]]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for name, row in named:
        found.setdefault(name, []).append(row.number)
    return found
