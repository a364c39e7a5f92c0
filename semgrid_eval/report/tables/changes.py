"""What each row of a matrix changes against the row that it is closest to, and what cannot be compared at all."""

from collections.abc import Sequence

from semgrid_eval.report.estimates.bootstrap import LABELS, RowScores, Scores
from semgrid_eval.report.rows.load import Row, comparable
from semgrid_eval.report.rows.pairing import DIFFERENCE_COLUMNS, main_group, shared_windows
from semgrid_eval.report.rows.settings import changed_settings, changed_targets, settings_of
from semgrid_eval.report.tables.table import (
    MINUS,
    Cell,
    Line,
    Table,
    difference_cell,
    interval_phrase,
    number,
    plain_table,
    plural,
)


def changes_table(scores: Scores) -> Table | None:
    """Show what each row changes against the row of its model above it that it is closest to, and what that does."""
    entries, lines = list(scores.values()), []
    for at, entry in enumerate(entries):
        base = _closest(entry, entries[:at])
        changed = changed_settings(settings_of(base.row), settings_of(entry.row)).values() if base else ()
        if base is None or not changed:
            continue
        cells = (Cell("; ".join(changed)), *(_change(entry, base, column) for column in DIFFERENCE_COLUMNS))
        sign = MINUS if comparable(entry.row, base.row) else "beside"
        lines.append(Line(f"{entry.row.name} {sign} {base.row.name}", cells))
    caption = (
        "What each row changes against the row above it that has the same model and the fewest other settings, "
        "and the difference of their scores. Where the targets are others, both scores are shown instead."
    )
    columns = ["Settings", *(LABELS[column] for column in DIFFERENCE_COLUMNS)]
    return plain_table("changes", caption, "Rows", columns, lines) if lines else None


def not_compared_table(scores: Scores) -> Table | None:
    """List the rows whose targets are others than those of the main group, and what makes them so."""
    rows = [entry.row for entry in scores.values()]
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.targets, []).append(row)
    if len(groups) < 2:
        return None
    main = main_group(rows)[0]
    with_main = groups.pop(main.targets)
    caption = (
        f"Not compared with {main.name} and the rows that share its targets. Scores are subtracted only between "
        "rows with the same targets: the same frames of the same logs, grid, mask mode and split."
    )
    lines = [_other_targets(group, with_main) for group in groups.values()]
    return plain_table("not-compared", caption, "Rows with the same targets", ("What differs", "Windows"), lines)


def _other_targets(group: Sequence[Row], with_main: Sequence[Row]) -> Line:
    """Say what makes the targets of a group of rows others than those of the row that they are closest to."""
    row = group[0]
    base = min(with_main, key=lambda other: len(changed_settings(settings_of(other), settings_of(row))))
    reasons = changed_targets(settings_of(base), settings_of(row)) or ["the logs or their frames"]
    shared = shared_windows(row, base)
    cells = (
        Cell(f"{'; '.join(reasons)} (against {base.name})"),
        Cell(f"{row.windows:,}", row.windows, f"{shared:,} shared"),
    )
    return Line(", ".join(each.name for each in group), cells)


def _closest(entry: RowScores, above: Sequence[RowScores]) -> RowScores | None:
    """Find the row of the same model and run with the fewest other settings, rather one with the same targets."""
    mine = entry.row

    def distance(other: RowScores) -> tuple[int, bool]:
        changed = changed_settings(settings_of(other.row), settings_of(mine))
        return len(changed), not comparable(mine, other.row)

    alike = (e for e in above if (e.row.record.facts.model, e.row.run) == (mine.record.facts.model, mine.run))
    return min(alike, key=distance, default=None)


def _change(entry: RowScores, base: RowScores, column: str) -> Cell:
    title = f"{plural(entry.row.windows, 'window')}; {plural(len(entry.row.results), 'result')}"
    if not comparable(entry.row, base.row):
        text = f"{number(entry.mean[column])}, {number(base.mean[column])}"
        return Cell(text, note="other targets", title=f"{title}; the targets differ, so there is no difference")
    difference = entry.minus(base, column)
    return difference_cell(difference, title=f"{title}; {interval_phrase(difference, with_sign=True)}")
