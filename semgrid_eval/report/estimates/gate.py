"""A gate for changes: is a run clearly below an earlier one, row by row, by more than what is allowed?"""

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import isfinite, nan
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.faults import meant, not_one_of
from semgrid_eval.progress import Progress, silent
from semgrid_eval.report.estimates.bootstrap import SEED, Level, Resampling, Scores, classes_of, score_everywhere
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Row, Run, comparable, load_runs
from semgrid_eval.report.rows.pairing import changed_targets, settings_of
from semgrid_eval.scores import results
from semgrid_eval.scores.metrics.table import IOU, iou_of

OPTION = "fail-below"


@dataclass(frozen=True)
class Limit:
    """By how much the IoU of a column may fall: `least` is the lowest difference allowed, zero or negative."""

    column: str
    least: float


@dataclass(frozen=True)
class Verdict:
    """What a gate says of one row and limit; `difference` is the later run less the earlier one, paired."""

    row: str
    limit: Limit
    difference: Estimate

    @property
    def holds(self) -> bool:
        """Whether the later run is not clearly below: the upper end of the interval reaches the limit."""
        return self.difference.high >= self.limit.least

    def __str__(self) -> str:
        d, least = self.difference, self.limit.least
        what = "holds" if self.holds else "is clearly below"
        return f"{self.row}, {self.limit.column}: {d.value:+.4f} [{d.low:+.4f}, {d.high:+.4f}] {what} {least:.4f}"


def columns_of(run: Path) -> Collection[str]:
    """Return the columns that limits of a run may be of: the figures of the classes that its results have.

    Raises:
        InputError: the run cannot be read.
    """
    for result_id in (each for row in results.read_run(run).rows for each in row.results):
        with suppress(InputError):  # the gate says what is wrong with it
            return iou_of(results.read_result(results.result_folder(run, result_id)).classes).labels
    return IOU.labels


def parse_limit(text: str, columns: Collection[str]) -> Limit:
    """Read a limit, `COLUMN: DIFFERENCE`, such as `vehicles: -0.01`.

    Raises:
        InputError: it is written otherwise, there is no such column, or the difference is not one that may be lost.
    """
    column, sign, number = (part.strip() for part in text.rpartition(":"))
    try:
        least = float(number) if sign else nan
    except ValueError:
        least = nan
    if not isfinite(least):
        raise InputError(f"{text!r} is not of the form 'vehicles: -0.01'", field=OPTION)
    if column not in columns:
        raise InputError(not_one_of(column, columns), field=OPTION)
    if not -1.0 <= least <= 0.0:
        raise InputError(f"{text!r}: what may be lost of an IoU is a number from -1 to 0", field=OPTION)
    return Limit(column, least)


@dataclass(frozen=True)
class Gate:
    """What was compared, and the rows of the earlier run that were not, since the later one does not have them."""

    verdicts: tuple[Verdict, ...]
    missing: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether every limit holds."""
        return all(each.holds for each in self.verdicts)


def check_gate(
    folders: tuple[Path, Path],
    limits: Sequence[Limit],
    *,
    rows: Sequence[str] = (),
    level: Level = "recordings",
    progress: Progress = silent,
) -> Gate:
    """Hold the rows of a later run, in pairs with those of an earlier one, to every limit.

    Args:
        folders: the earlier run, and the later one.
        limits: what each row has to keep.
        rows: compare these alone: names, patterns, or `NAME=OTHER` where the later run calls a row otherwise. Without
            them rows are compared that have the same name and, in the earlier run, a result.
        level: what intervals resample first.
        progress: told of each row read.

    Raises:
        InputError: a run cannot be read; no row is to be compared, or one is not there; a row has no result, other
            targets, or nothing that a limit could be held to.
    """
    before, after = load_runs(folders, progress=progress)
    pairs = _asked(before, after, rows) if rows else _shared(before, after)
    verdicts = hold(pairs, limits, Resampling(SEED, level=level))
    return Gate(verdicts, () if rows else tuple(_lost(before, after)))


def hold(pairs: Sequence[tuple[Row, Row]], limits: Sequence[Limit], resampling: Resampling) -> tuple[Verdict, ...]:
    """Hold the second row of each pair to every limit; an InputError says what cannot be compared."""
    for one, other in pairs:
        _require_comparable(one, other)
    both = [row for pair in pairs for row in pair]
    scores = score_everywhere(both, iou_of(classes_of(both)), resampling)
    return tuple(_verdict(scores, pair, limit) for pair in pairs for limit in limits)


def _by_name(run: Run) -> dict[str, Row]:
    return {row.record.name: row for row in run.rows}


def _shared(before: Run, after: Run) -> list[tuple[Row, Row]]:
    ours, theirs = _by_name(before), _by_name(after)
    pairs = [(row, theirs[name]) for name, row in ours.items() if name in theirs and row.results]
    if not pairs:
        raise InputError(f"has no row with a result of {before.folder}: {', '.join(ours)}", path=after.folder)
    return pairs


def _lost(before: Run, after: Run) -> Iterator[str]:
    theirs = _by_name(after)
    return (name for name, row in _by_name(before).items() if row.results and name not in theirs)


def _asked(before: Run, after: Run, rows: Sequence[str]) -> list[tuple[Row, Row]]:
    ours, theirs = _by_name(before), _by_name(after)
    named = dict.fromkeys(pair for each in rows for pair in _named(each, before, after))
    return [(ours[one], theirs[other]) for one, other in named]


def _named(asked: str, before: Run, after: Run) -> list[tuple[str, str]]:
    """Find what is asked for: a name, `NAME=OTHER`, or a pattern of names that are in both runs."""
    ours, theirs = _by_name(before), _by_name(after)
    cuts = [(asked[:at], asked[at + 1 :]) for at, sign in enumerate(asked) if sign == "="]
    exact = [pair for pair in ((asked, asked), *cuts) if pair[0] in ours and pair[1] in theirs]
    found = exact[:1] or [(name, name) for name in ours if name in theirs and fnmatchcase(name, asked)]
    if not found and cuts:
        _refuse_half(cuts, before, after)
    if not found:
        shared = [name for name in ours if name in theirs]
        raise InputError(f"{asked!r} is not a row of both runs: {', '.join(shared)}{meant(asked, shared)}", field="row")
    return found


def _refuse_half(pairs: Sequence[tuple[str, str]], before: Run, after: Run) -> None:
    """Say which half of `NAME=OTHER` is not a row of its run."""
    ours, theirs = _by_name(before), _by_name(after)
    one, other = next((pair for pair in pairs if pair[0] in ours or pair[1] in theirs), pairs[0])
    if one not in ours:
        raise InputError(not_one_of(one, ours), path=before.folder, field="row")
    raise InputError(not_one_of(other, theirs), path=after.folder, field="row")


def _require_comparable(one: Row, other: Row) -> None:
    for row in (one, other):
        if not row.results:
            reason = "; ".join(row.failures) or row.record.skipped or "its turn has not come"
            raise InputError(f"row {row.record.name} has no result to compare: {reason}", path=row.run)
    if not comparable(one, other):
        changed = ", ".join(changed_targets(settings_of(one), settings_of(other))) or "other logs or frames"
        name = other.record.name
        raise InputError(f"row {name} has other targets than in {one.run}: {changed}", path=other.run)


def _verdict(scores: Scores, pair: tuple[Row, Row], limit: Limit) -> Verdict:
    one, other = pair
    if one.name not in scores or other.name not in scores:
        raise InputError(f"row {other.record.name} has no cell to score", path=other.run)
    difference = scores[other.name].minus(scores[one.name], limit.column)
    if not isfinite(difference.value):
        raise InputError(f"row {other.record.name} has no cell of {limit.column}", path=other.run)
    if not isfinite(difference.high):
        reason = f"one recording alone has cells of {limit.column}: an interval needs more"
        raise InputError(f"row {other.record.name}: {reason}", path=other.run)
    return Verdict(other.record.name, limit, difference)
