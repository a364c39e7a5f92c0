"""The pictures of an example window: camera, segmentation and grids over time, predictions, who is right, certainty."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays
from semgrid_eval.report.cells import ABSENT, number, signed
from semgrid_eval.report.examples import Contest, Pick, by_window, key_of, mean_iou, positions
from semgrid_eval.report.glimpses import Glimpses, times
from semgrid_eval.report.pictures import (
    HATCHED,
    LEGEND,
    Grid,
    Picture,
    certainty_png,
    data_uri,
    grid_picture,
    right_png,
)
from semgrid_eval.report.reading import Row
from semgrid_eval.report.view import Crop, View
from semgrid_eval.scores.results import PREDICTIONS_FILE, windows_file

Arrays = Mapping[str, NDArray[np.generic]]

_FEWEST_COLUMNS, _MOST_COLUMNS = 4, 6


@dataclass(frozen=True)
class Column:
    """Pictures of one moment, one above the other, with a title and a small second line.

    Args:
        step: whether it belongs to the way from the inputs over the target to the prediction.
    """

    title: str
    note: str
    pictures: tuple[Picture, ...]
    step: bool = True

    @property
    def grids(self) -> int:
        """How many of the pictures are grids."""
        return sum(picture.kind == "grid" for picture in self.pictures)


@dataclass(frozen=True)
class Example:
    """One example window, ready to be shown.

    Args:
        title: why it was chosen.
        times: of the target, in several forms.
        command: plays the recording.
        film: inputs and target in the order of time.
        answers: predictions and what follows from them.
        crops: parts of the camera's image that act as sensors.
        hatching: a picture to lay over grids.
    """

    title: str
    recording: str
    log: str
    frame: int
    times: tuple[str, ...]
    command: str
    film: tuple[Column, ...]
    answers: tuple[Column, ...]
    legend: tuple[tuple[str, str], ...]
    crops: tuple[Crop, ...] = ()
    hatching: str = ""

    @property
    def columns(self) -> int:
        """How many columns stand side by side on a wide screen."""
        return max(_FEWEST_COLUMNS, min(_MOST_COLUMNS, max(len(self.film), len(self.answers))))


def draw_examples(contest: Contest, picks: Sequence[Pick], glimpses: Glimpses) -> Iterator[Example]:
    """Draw the chosen windows of a contest, each window once.

    Raises:
        ResultError: arrays of the windows or of a prediction are missing or damaged.
    """
    groups = by_window(picks)
    result, at = contest.result, [group[0].index for group in groups]
    shown = _Shown(contest, at)
    for i, group in enumerate(groups):
        window = result.record.windows[at[i]]
        kept = glimpses.of(window.log, result)
        view = View(window, kept, result.grid, contest.model.record.sensors)
        film = tuple(shown.film(i, view))
        answers = tuple(shown.answers(i))
        hatching = view.hatching
        yield Example(
            title="; ".join(f"{pick.reason}: {_score(contest, pick)}" for pick in group),
            recording=window.recording,
            log=window.log,
            frame=window.target_frame,
            times=times(window.target_stamp_ns, kept),
            command=glimpses.play_command(contest.model, window),
            film=film,
            answers=answers,
            legend=_legend([*film, *answers], {HATCHED} if hatching else set()),
            crops=view.crops if kept is not None else (),
            hatching=hatching,
        )


class _Shown:
    """The arrays of a contest's chosen windows, by their place among those chosen."""

    def __init__(self, contest: Contest, at: Sequence[int]) -> None:
        self._contest, self._at = contest, at
        self._windows = [contest.result.record.windows[i] for i in at]
        path = windows_file(contest.model.run, contest.result.record.windows_id)
        self._seen = _read(path, ("inputs", "target", "mask"), at)
        self._mine = _read(contest.result.folder / PREDICTIONS_FILE, ("prediction", "certainty"), at)
        rows = [row for row in (*contest.rivals, *contest.baselines) if row is not None]
        self._others = {row.name: self._predictions(row) for row in rows}
        self._newest = {row.name: self._newest_inputs(row) for row in contest.rivals} if contest.baselines else {}

    def film(self, i: int, view: View) -> Iterator[Column]:
        """Give the inputs and the target; where the contest is about horizons, each row's newest input and answer."""
        yield from self._horizons(i, view) if self._contest.baselines else self._inputs(i, view)
        mask = np.asarray(self._seen["mask"][i], np.bool_)
        target = grid_picture("Target", "Target grid with mask M in white", self._grid("target", i), mask)
        photos = view.photos(view.window.target_stamp_ns, "at the target's time")
        yield Column("Target", "to be predicted", (*photos, target))

    def answers(self, i: int) -> Iterator[Column]:
        """Give the prediction, those of rivals, who is right, and certainty."""
        if self._contest.baselines:
            return
        model = self._contest.model
        prediction, target = self._grid("prediction", i), self._grid("target", i)
        yield self._answer(model, i, prediction, step=True)
        there = [(row, grid) for row in self._contest.rivals if (grid := self._others[row.name][i]) is not None]
        for row, grid in there:
            yield self._answer(row, i, grid, step=False)
        for row, grid in there[:1]:
            alt = f"Cells where {model.name} or {row.name} is right"
            right = right_png(target, prediction, grid, np.asarray(self._seen["mask"][i], np.bool_))
            yield Column("Who is right", "cell by cell", (Picture("", alt, data_uri(right)),), step=False)
        certainty = np.asarray(self._mine["certainty"][i], np.uint8)
        if certainty.min() < certainty.max():  # a baseline is equally certain of everything
            alt = f"Certainty of {model.name}, light is certain"
            yield Column(
                "Certainty", "light is certain", (Picture("", alt, data_uri(certainty_png(certainty))),), False
            )

    def _inputs(self, i: int, view: View) -> Iterator[Column]:
        inputs, names = self._grid("inputs", i), self._contest.model.record.sensors
        sensors, steps = inputs.shape[:2]
        for t in range(steps):
            title, stamp_ns = f"Input {t + 1} of {steps}", view.input_stamp_ns(steps - 1 - t)
            grids = (_input_picture(inputs[s, t], title, names[s] if sensors > 1 else "") for s in range(sensors))
            yield Column(title, view.before(stamp_ns), (*view.photos(stamp_ns, title), *grids))

    def _horizons(self, i: int, view: View) -> Iterator[Column]:
        """Give a column for each horizon, the farthest first: what was known then, and what was made of it."""
        contest = self._contest
        for row, baseline in reversed(list(zip((contest.model, *contest.rivals), contest.baselines, strict=True))):
            inputs, stamp_ns = self._known(row, i)
            answer = self._grid("prediction", i) if row is contest.model else self._others[row.name][i]
            if inputs is None or answer is None:
                continue
            title = f"Newest input of {row.name}"
            names = row.record.sensors if len(inputs) > 1 else ("",)
            grids = [_input_picture(grid, title, name, lead=False) for grid, name in zip(inputs, names, strict=True)]
            grids.append(grid_picture(f"{row.name}{self._iou(row, i)}", f"Prediction of {row.name}", answer))
            theirs = None if baseline is None else self._others[baseline.name][i]
            if baseline is not None and theirs is not None:
                name = baseline.name
                grids.append(
                    grid_picture(f"{name}{self._iou(baseline, i)}", f"Prediction of {name}", theirs, lead=False)
                )
            steps = row.record.horizon_steps
            title = f"{steps} step{'s' if steps > 1 else ''} ahead"
            yield Column(title, view.before(stamp_ns), (*view.photos(stamp_ns, title), *grids))

    def _known(self, row: Row, i: int) -> tuple[Grid | None, int | None]:
        """Return a row's newest inputs (S, H, W) in a window and their time."""
        if row is self._contest.model:
            stamps = self._windows[i].input_stamps_ns
            return self._grid("inputs", i)[:, -1], stamps[-1] if stamps else None
        return self._newest[row.name][i]

    def _answer(self, row: Row, i: int, grid: Grid, *, step: bool) -> Column:
        note = self._iou(row, i).removeprefix(", ")
        return Column(row.name, note, (grid_picture("", f"Prediction of {row.name}", grid),), step)

    def _iou(self, row: Row, i: int) -> str:
        value = number(mean_iou(row.shown, self._windows[i]))
        return "" if value == ABSENT else f", mean IoU {value}"

    def _grid(self, name: str, i: int) -> Grid:
        return np.asarray((self._mine if name in self._mine else self._seen)[name][i], np.uint8)

    def _predictions(self, row: Row) -> list[Grid | None]:
        arrays, places = self._theirs(row, row.shown.folder / PREDICTIONS_FILE, "prediction")
        return [None if place is None else np.asarray(arrays[place], np.uint8) for place in places]

    def _newest_inputs(self, row: Row) -> list[tuple[Grid | None, int | None]]:
        record = row.shown.record
        arrays, places = self._theirs(row, windows_file(row.run, record.windows_id), "inputs")
        at = positions(row.shown)
        found: list[tuple[Grid | None, int | None]] = []
        for window, place in zip(self._windows, places, strict=True):
            if place is None:
                found.append((None, None))
                continue
            stamps = record.windows[at[key_of(window)]].input_stamps_ns
            found.append((np.asarray(arrays[place][:, -1], np.uint8), stamps[-1] if stamps else None))
        return found

    def _theirs(self, row: Row, path: Path, name: str) -> tuple[NDArray[np.generic], list[int | None]]:
        """Read an array at the windows that a row shares, and say where in it each chosen window is."""
        at = positions(row.shown)
        there = [at[key_of(window)] for window in self._windows if key_of(window) in at]
        array = _read(path, (name,), there)[name] if there else np.zeros(0, np.uint8)
        count = iter(range(len(there)))
        return array, [next(count) if key_of(window) in at else None for window in self._windows]


def _input_picture(grid: Grid, title: str, sensor: str, *, lead: bool = True) -> Picture:
    name = f"{title}, {sensor}" if sensor else title
    return grid_picture(sensor or "Newest input", f"{name}, aligned to the target", grid, lead=lead)


def _score(contest: Contest, pick: Pick) -> str:
    return signed(pick.score) if contest.rivals else number(pick.score)


def _legend(columns: Iterable[Column], more: set[int]) -> tuple[tuple[str, str], ...]:
    """Name the colours that appear in an example."""
    there = more.union(*(picture.colours for column in columns for picture in column.pictures))
    return tuple(LEGEND[i] for i in sorted(there))


def _read(path: Path, names: tuple[str, ...], at: Sequence[int]) -> Arrays:
    arrays = read_arrays(path, names)
    return {name: array[list(at)] for name, array in arrays.items()}
