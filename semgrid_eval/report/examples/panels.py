"""The pictures of an example window: camera, segmentation and grids over time, predictions, who is right, certainty."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.examples import drawing
from semgrid_eval.report.examples.choose import Contest, Pick, by_window, mean_iou
from semgrid_eval.report.examples.thumbnails import Crop, RunThumbnails, View, times
from semgrid_eval.report.rows.load import Row, WindowReader, key_of
from semgrid_eval.report.tables.numbers import ABSENT, number, signed
from semgrid_eval.scores.results import WindowRecord, read_predictions, read_windows
from semgrid_eval.words import plural

_FEWEST_COLUMNS, _MOST_COLUMNS = 4, 6
_TARGET = ("Target", "Target grid with mask M in white")


@dataclass(frozen=True)
class Column:
    """Pictures of one moment, one above the other, with a title and a small second line."""

    title: str
    note: str
    pictures: tuple[drawing.Picture, ...]
    step: bool = True  # whether it belongs to the way from the inputs over the target to the prediction
    row: int | None = None  # number of the row whose answer it shows

    @property
    def grids(self) -> int:
        """How many of the pictures are grids."""
        return sum(picture.kind == "grid" for picture in self.pictures)


@dataclass(frozen=True)
class Example:
    """One example window, ready to be shown."""

    title: str  # why it was chosen
    window: WindowRecord
    times: tuple[str, ...]  # of the target, in several forms
    command: str  # plays the recording
    film: tuple[Column, ...]  # inputs and target in the order of time
    answers: tuple[Column, ...]  # predictions and what follows from them
    legend: tuple[tuple[str, str], ...]
    crops: tuple[Crop, ...] = ()  # parts of the camera's image that act as sensors
    hatching: str = ""  # a picture to lay over grids

    @property
    def columns(self) -> int:
        """How many columns stand side by side on a wide screen."""
        return max(_FEWEST_COLUMNS, min(_MOST_COLUMNS, max(len(self.film), len(self.answers))))


class Shown:
    """The arrays of a contest at some of its windows, by the windows' indices in the contest's result.

    Raises:
        ResultError: arrays of the windows or of a prediction are missing or damaged.
    """

    def __init__(self, contest: Contest, at: Iterable[int], read: WindowReader = read_windows) -> None:
        self.contest, self._classes = contest, contest.model.classes
        self._windows = {i: contest.result.record.windows[i] for i in at}
        asked = (contest.model, *contest.rivals)
        answering = {row.name: row for row in (*asked, *contest.baselines) if row is not None}
        seeing = asked if contest.baselines else asked[:1]
        self._seen = {row.name: self._of(row, read(*row.window_set)) for row in seeing}
        self._answers = {name: self._of(row, read_predictions(row.shown.folder)) for name, row in answering.items()}

    def film(self, i: int, view: View) -> Iterator[Column]:
        """Return the inputs and the target; where the contest is about horizons, each row's newest input and answer."""
        yield from self._horizons(i, view) if self.contest.baselines else self._inputs(i, view)
        seen = self._seen[self.contest.model.name][i]
        target = drawing.masked_picture(_TARGET, seen["target"], seen["mask"] > 0, self._classes)
        photos = view.photos(view.window.target_stamp_ns, "at the target's time")
        yield Column("Target", "to be predicted", (*photos, target))

    def answers(self, i: int) -> Iterator[Column]:
        """Return the prediction, those of rivals, who is right, and certainty."""
        if self.contest.baselines:
            return
        model = self.contest.model
        seen, mine = self._seen[model.name][i], self._answers[model.name][i]
        yield self._answer(model, i, step=True)
        there = [row for row in self.contest.rivals if i in self._answers[row.name]]
        for row in there:
            yield self._answer(row, i, step=False)
        for row in there[:1]:
            alt, theirs = f"Cells where {model.name} or {row.name} is right", self._answers[row.name][i]
            right = drawing.right_png(seen["target"], mine["prediction"], theirs["prediction"], seen["mask"] > 0)
            picture = drawing.Picture("", alt, drawing.data_uri(right))
            yield Column("Who is right", "cell by cell", (picture,), step=False, row=row.number)
        certainty = mine["certainty"]
        if certainty.min() < certainty.max():  # a baseline is equally certain of everything
            alt = f"Certainty of {model.name}, light is certain"
            picture = drawing.Picture("", alt, drawing.data_uri(drawing.certainty_png(certainty, self._classes.count)))
            yield Column("Certainty", "light is certain", (picture,), step=False)

    def _inputs(self, i: int, view: View) -> Iterator[Column]:
        model = self.contest.model
        inputs, names = self._seen[model.name][i]["inputs"], model.record.facts.sensors
        sensors, steps = inputs.shape[:2]
        for t, stamp_ns in enumerate(view.window.input_stamps_ns):
            title = f"Input {t + 1} of {steps}"
            grids = (self._input(inputs[s, t], title, names[s] if sensors > 1 else "") for s in range(sensors))
            yield Column(title, view.before(stamp_ns), (*view.photos(stamp_ns, title), *grids))

    def _horizons(self, i: int, view: View) -> Iterator[Column]:
        """Return a column for each horizon, the farthest first: what was known then, and what was made of it."""
        contest = self.contest
        for row, baseline in reversed(list(zip((contest.model, *contest.rivals), contest.baselines, strict=True))):
            if i not in self._seen[row.name]:
                continue
            inputs = self._seen[row.name][i]["inputs"][:, -1]  # (S, H, W)
            title = f"Newest input of {row.name}"
            names = row.record.facts.sensors if len(inputs) > 1 else ("",)
            grids = [self._input(grid, title, name, lead=False) for grid, name in zip(inputs, names, strict=True)]
            grids.append(self._prediction(row, i, f"{row.name}{self._iou(row, i)}"))
            if baseline is not None and i in self._answers[baseline.name]:
                title = f"{baseline.name}{self._iou(baseline, i)}"
                grids.append(self._prediction(baseline, i, title, lead=False))
            title = f"{plural(row.record.facts.horizon_steps, 'step')} ahead"
            stamp_ns = row.shown.record.windows[row.shown.places[key_of(self._windows[i])]].input_stamps_ns[-1]
            yield Column(title, view.before(stamp_ns), (*view.photos(stamp_ns, title), *grids))

    def _answer(self, row: Row, i: int, *, step: bool) -> Column:
        return Column(row.name, self._iou(row, i).removeprefix(", "), (self._prediction(row, i, ""),), step, row.number)

    def _prediction(self, row: Row, i: int, title: str, *, lead: bool = True) -> drawing.Picture:
        grid = self._answers[row.name][i]["prediction"]
        return drawing.grid_picture((title, f"Prediction of {row.name}"), grid, self._classes, lead=lead)

    def _input(self, grid: drawing.Grid, title: str, sensor: str, *, lead: bool = True) -> drawing.Picture:
        words = sensor or "Newest input", f"{title}, {sensor}" if sensor else title
        return drawing.grid_picture((words[0], f"{words[1]}, aligned to the target"), grid, self._classes, lead=lead)

    def _iou(self, row: Row, i: int) -> str:
        value = number(mean_iou(row.shown, self._windows[i]))
        return "" if value == ABSENT else f", mean IoU {value}"

    def _of(self, row: Row, arrays: Mapping[str, NDArray[np.generic]]) -> dict[int, dict[str, drawing.Grid]]:
        """Copy what arrays hold of the windows that a row has, so that the rest need not be kept."""
        places, found = row.shown.places, {}
        for i, window in self._windows.items():
            if (place := places.get(key_of(window))) is not None:
                found[i] = {name: np.array(array[place], np.uint8) for name, array in arrays.items()}
        return found


def draw_examples(shown: Shown, picks: Sequence[Pick], thumbnails: RunThumbnails) -> Iterator[Example]:
    """Draw the chosen windows of a contest, each window once."""
    contest, result = shown.contest, shown.contest.result
    legend = drawing.legend(classes := contest.model.classes)
    for group in by_window(picks):
        index = group[0].index
        window = result.record.windows[index]
        kept = thumbnails.of(window.log, result)
        view = View(window, kept, result.grid, contest.model.record.facts.sensors)
        film, answers, hatching = tuple(shown.film(index, view)), tuple(shown.answers(index)), view.hatching
        colours = set[int]().union(*(each.colours for column in (*film, *answers) for each in column.pictures))
        yield Example(
            title="; ".join(f"{pick.reason}: {(signed if contest.rivals else number)(pick.score)}" for pick in group),
            window=window,
            times=times(window.target_stamp_ns, kept),
            command=thumbnails.command(contest.model, window),
            film=film,
            answers=answers,
            legend=tuple(legend[i] for i in sorted(colours | ({drawing.hatched(classes)} if hatching else set()))),
            crops=() if kept is None else view.crops,
            hatching=hatching,
        )
