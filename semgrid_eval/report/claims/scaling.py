"""How a run's trainings differ from those of the paper, in one line."""

from collections.abc import Iterable, Sequence

from semgrid_eval.report.claims.paper import PAPER_DATASET, PAPER_REPEATS, PAPER_SETTINGS, PAPER_WINDOWS, in_paper
from semgrid_eval.report.rows.load import Row, Run


def scaling(run: Run) -> str:
    """Say how the training of rows that the paper has, too, differs from the paper's; empty if none was trained."""
    rows = [row for row in run.rows if row.results and in_paper(row.record.name)]
    trained = [row for row in rows if row.results[0].record.seed is not None]
    if not trained:
        return ""
    found = [_difference(text, _values(trained, key), theirs) for key, (text, theirs) in PAPER_SETTINGS.items()]
    found.append(_difference("repeats", {len(row.results) for row in trained}, PAPER_REPEATS))
    found.append(_difference("scored windows", {row.windows for row in rows}, PAPER_WINDOWS))
    sources = {log.dataset for log in run.record.logs}
    others = " and ".join(sorted(sources - {PAPER_DATASET}))
    place = "besides" if PAPER_DATASET in sources else "instead of"
    found.append(f"data {others} {place} Cityscapes" if others else "")
    told = [text for text in found if text]
    if not told:
        return "Trained as the paper's supplement says."
    return f"Scaled from the paper's supplement: {', '.join(told)}."


def _values(rows: Sequence[Row], key: str) -> set[object]:
    """Collect the values of a setting that results state."""
    return {result.settings[key] for row in rows for result in row.results if key in result.settings}


def _difference(text: str, ours: Iterable[object], theirs: float) -> str:
    values = sorted(set(ours), key=str)
    if not values or values == [theirs]:
        return ""
    shown = " or ".join("none" if value is None else f"{value:,}" for value in values)
    return f"{text} {shown} instead of {theirs:,}"
