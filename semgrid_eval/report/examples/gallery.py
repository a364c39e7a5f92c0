"""The example windows of a page: who is measured against whom, which windows show it, and what cannot be shown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.examples.choose import Contest, Pick, choose, choose_by_class, contests
from semgrid_eval.report.examples.panels import Example, Shown, draw_examples
from semgrid_eval.report.examples.thumbnails import RunThumbnails
from semgrid_eval.report.rows.load import Row, Run, WindowReader
from semgrid_eval.report.rows.pairing import Headline
from semgrid_eval.scores.results import read_windows

_BEST, _WORST, _OTHER = 3, 3, 1


@dataclass(frozen=True)
class Group:
    """The example windows of one contest, or in words why there are none."""

    title: str
    hint: str  # what is special about it
    rule: str  # by which its windows were chosen
    seed: int | None  # of the predictions shown
    windows: tuple[Example, ...]
    problem: str
    row: int  # number of the model's row
    looks_ahead: bool = False  # whether its rows look ahead differently far
    shown: bool = False  # whether the group is open when the page is opened
    aside: bool = False  # whether it is about another row than the page's main one


def example_groups(runs: Sequence[Run], rows: Sequence[Row], found: Headline | None) -> list[Group]:
    """Draw the example windows: the main contest, its classes, and one good and one bad window of the others."""
    chosen = contests(rows, found)
    if not chosen:
        return []
    kept = {run.folder: RunThumbnails(run) for run in runs}
    main, *others = chosen
    plans = [_main_plan(main)]
    plans += [{"": choose(each, best=_OTHER, worst=_OTHER)} for each in others]
    read = lru_cache(1)(read_windows)  # contests that share windows are drawn one after the other
    order = sorted(range(len(chosen)), key=lambda i: chosen[i].model.window_set)
    drawn = {i: groups_of(chosen[i], plans[i], kept[chosen[i].model.run], read) for i in order}
    aside = {i for i, each in enumerate(chosen) if each.model != main.model}
    first, *rest = (replace(group, aside=i in aside) for i in sorted(drawn) for group in drawn[i])
    return [replace(first, shown=True), *rest]


def _main_plan(contest: Contest) -> dict[str, Sequence[Pick]]:
    """Choose a good and a bad window to begin with, more of both, and then some by class."""
    picks = choose(contest, best=_BEST, worst=_WORST)
    lead = {pick.reason: pick for pick in reversed(picks)}.values()
    more = [pick for pick in picks if pick not in lead]
    return {
        "": [pick for pick in picks if pick in lead],
        **({", more windows": more} if more else {}),
        ", class by class": choose_by_class(contest),
    }


def groups_of(
    contest: Contest, plan: Mapping[str, Sequence[Pick]], thumbnails: RunThumbnails, read: WindowReader = read_windows
) -> list[Group]:
    """Draw the chosen windows of a contest, a group for each end of its title; what cannot be read is their problem."""
    windows: dict[str, tuple[Example, ...]] = dict.fromkeys(plan, ())
    problem = ""
    try:
        shown = Shown(contest, {pick.index for picks in plan.values() for pick in picks}, read)
        windows = {end: tuple(draw_examples(shown, picks, thumbnails)) for end, picks in plan.items()}
    except (SemgridError, ValueError, IndexError) as error:
        problem = f"The pictures of {contest.model.name} cannot be shown: {error}"
    found = []
    for end, picks in plan.items():
        title, hint, seed = _title(contest) + end, _hint(contest, windows[end]), contest.result.record.seed
        why = problem if picks else "No window has enough cells of any class."
        row, ahead = contest.model.number, bool(contest.baselines)
        found.append(Group(title, hint, contest.rule, seed, windows[end], why, row, looks_ahead=ahead))
    return found


def gaps(rows: Sequence[Row], groups: Sequence[Group]) -> list[str]:
    """Say which kinds of examples this run cannot show, and why."""
    if not groups:
        return []
    said = []
    if not any(len(row.record.facts.sensors) > 1 for row in rows):
        said.append("No row has several sensors, so there is no example with a blind band.")
    if not any(group.looks_ahead for group in groups):
        said.append("The model shown first was not run with several horizons, so there is no example of them in a row.")
    columns = [column for group in groups for window in group.windows for column in window.film]
    if columns and all(picture.kind == "grid" for column in columns for picture in column.pictures):
        said.append(
            "There are no pictures of what sensors saw: the run kept none of its logs, or they hold none. "
            "Started again where its logs are, semgrid-eval run adds what is missing."
        )
    return said


def widths(rows: Sequence[Row]) -> str:
    """Say how wide the grids of rows are."""
    specs = ((row.shown.grid or GridConfig()).spec for row in rows)
    widths_m = {spec.columns * spec.cell_m for spec in specs}
    return " or ".join(f"{width_m:g} m" for width_m in sorted(widths_m))


def _title(contest: Contest) -> str:
    names = [contest.model.name, *(rival.name for rival in contest.rivals)]
    if contest.baselines:
        return f"Looking further ahead: {', '.join(names)}"
    return names[0] + (f" against {' and '.join(names[1:])}" if names[1:] else "")


def _hint(contest: Contest, windows: Sequence[Example]) -> str:
    if contest.baselines:
        return (
            "Each column asks the same model for the same target, the farther to the left the earlier: "
            "the newest input that it had, what it predicted, and the baseline's answer to the same question."
        )
    if any(window.hatching for window in windows):
        return (
            "The frames in the camera image are the sensors. Hatched is the ground that the camera sees and no sensor "
            "of an input does. It is taken as flat, so walls and vehicles may reach into it. What a model says there "
            "it has learned."
        )
    if len(contest.model.record.facts.sensors) > 1:
        return "Each input is seen by several sensors."
    return ""
