"""The example windows of a page: who is measured against whom, which windows show it, and what cannot be shown."""

from collections.abc import Sequence
from dataclasses import dataclass

from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.spec import TARGET_SENSOR
from semgrid_eval.report.comparison import Headline
from semgrid_eval.report.examples import Contest, Pick, choose, choose_by_class, contests
from semgrid_eval.report.glimpses import Glimpses
from semgrid_eval.report.panels import Example, draw_examples
from semgrid_eval.report.reading import Row

_BEST, _WORST, _OTHER = 3, 3, 1
_AHEAD = "Looking further ahead"


@dataclass(frozen=True)
class Group:
    """The example windows of one contest, or in words why there are none.

    Args:
        hint: what is special about it.
        rule: by which its windows were chosen.
        seed: of the predictions shown.
        shown: whether the group is open when the page is opened.
    """

    title: str
    hint: str
    rule: str
    seed: int | None
    windows: tuple[Example, ...]
    problem: str
    shown: bool


def example_groups(rows: Sequence[Row], found: Headline | None) -> list[Group]:
    """Draw the example windows: the main contest, its classes, and one good and one bad window of the others."""
    chosen = contests(rows, found)
    if not chosen:
        return []
    kept = {run: Glimpses(run) for run in dict.fromkeys(contest.model.run for contest in chosen)}
    main, *others = chosen
    plans = [
        (main, choose(main, best=_BEST, worst=_WORST), ""),
        (main, choose_by_class(main), ", class by class"),
        *((each, choose(each, best=_OTHER, worst=_OTHER), "") for each in others),
    ]
    return [
        example_group(contest, picks, kept[contest.model.run], note=note, shown=not i)
        for i, (contest, picks, note) in enumerate(plans)
    ]


def example_group(
    contest: Contest, picks: Sequence[Pick], glimpses: Glimpses, *, note: str = "", shown: bool = False
) -> Group:
    """Draw the chosen windows of a contest; arrays that cannot be read become the group's problem."""
    windows: tuple[Example, ...] = ()
    problem = "" if picks else "No window has enough cells of any class."
    try:
        windows = tuple(draw_examples(contest, picks, glimpses)) if picks else ()
    except (SemgridError, ValueError, IndexError) as error:
        problem = f"The pictures of {contest.model.name} cannot be shown: {error}"
    seed = contest.result.record.seed
    return Group(_title(contest) + note, _hint(contest, windows), contest.rule, seed, windows, problem, shown)


def gaps(rows: Sequence[Row], groups: Sequence[Group]) -> list[str]:
    """Say which kinds of examples this run cannot show, and why."""
    if not groups:
        return []
    said = []
    if not any(len(row.record.sensors) > 1 for row in rows):
        said.append("No row has several sensors, so there is no example with a blind band.")
    if not any(group.title.startswith(_AHEAD) for group in groups):
        said.append("The model was not run with several horizons, so there is no example of them in a row.")
    shown = [window for group in groups for window in group.windows]
    pictures = [picture for window in shown for column in window.film for picture in column.pictures]
    if shown and not any(picture.kind == "camera" for picture in pictures):
        said.append(
            "There are no camera images: the run kept none of its logs, or they hold none. "
            "Started again where its logs are, semgrid-eval run adds what is missing."
        )
    return said


def _title(contest: Contest) -> str:
    names = [contest.model.name, *(rival.name for rival in contest.rivals)]
    if contest.baselines:
        return f"{_AHEAD}: {', '.join(names)}"
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
    if any(name != TARGET_SENSOR for name in contest.model.record.sensors) and len(contest.model.record.sensors) > 1:
        return "Each input is seen by several sensors; the target comes from the whole image."
    return ""
