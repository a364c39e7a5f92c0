"""The pictures of one example window, side by side: inputs, target, predictions, who is right, certainty."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays
from semgrid_eval.errors import SemgridError
from semgrid_eval.report.cells import number, signed
from semgrid_eval.report.examples import Contest, Pick, key_of, positions
from semgrid_eval.report.pictures import CLASS_LEGEND, MASK_LEGEND, certainty_png, data_uri, grid_png, right_png
from semgrid_eval.report.reading import Result
from semgrid_eval.scores.results import PREDICTIONS_FILE, windows_file

Grid = NDArray[np.uint8]

_EPOCH_FROM_NS = 10**17  # stamps beyond 1973 are dates, smaller ones are times since the start of a log


@dataclass(frozen=True)
class Picture:
    """One picture: title, what it shows (its alternative text) and the data URI."""

    title: str
    alt: str
    uri: str
    step: bool = False  # whether it belongs to the way from the inputs over the target to the prediction


@dataclass(frozen=True)
class Example:
    """One example window, ready to be shown."""

    title: str
    recording: str
    log: str
    frame: int
    time: str
    pictures: tuple[Picture, ...]
    legend: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Group:
    """The example windows of one contest, or in words why there are none."""

    title: str
    rule: str
    seed: int | None
    windows: tuple[Example, ...]
    problem: str
    shown: bool  # whether the group is open when the page is opened


def example_group(contest: Contest, picks: Sequence[Pick], *, note: str = "", shown: bool = False) -> Group:
    """Draw the chosen windows of a contest; arrays that cannot be read become the group's problem."""
    windows: tuple[Example, ...] = ()
    problem = "" if picks else "No window has enough cells of any class."
    try:
        windows = tuple(_draw(contest, picks)) if picks else ()
    except (SemgridError, ValueError, IndexError) as error:
        problem = f"The pictures of {contest.model.name} cannot be shown: {error}"
    against = " and ".join(rival.name for rival in contest.rivals)
    title = f"{contest.model.name} against {against}" if against else contest.model.name
    return Group(title + note, contest.rule, contest.result.record.seed, windows, problem, shown)


def shown_time(stamp_ns: int) -> str:
    """Write a time stamp: a date where it is one, else seconds."""
    if stamp_ns < _EPOCH_FROM_NS:
        return f"{stamp_ns / 1e9:.3f} s"
    return f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S}.{stamp_ns % 10**9 // 10**6:03d} UTC"


def _draw(contest: Contest, picks: Sequence[Pick]) -> Iterator[Example]:
    result, at = contest.result, [pick.index for pick in picks]
    path = windows_file(contest.model.run, result.record.windows_id)
    shown = _read(path, ("inputs", "target", "mask"), at)
    mine = _read(result.folder / PREDICTIONS_FILE, ("prediction", "certainty"), at)
    rivals = {rival.name: _rival_predictions(result, rival.shown, at) for rival in contest.rivals}
    for i, pick in enumerate(picks):
        window = result.record.windows[pick.index]
        grids = {name: array[i] for name, array in (shown | mine).items()}
        theirs = {name: grid for name, grids_of in rivals.items() if (grid := grids_of[i]) is not None}
        pictures = tuple(_pictures(contest, grids, theirs))
        score = signed(pick.score) if contest.rivals else number(pick.score)
        yield Example(
            title=f"{pick.reason}: {score}",
            recording=window.recording,
            log=window.log,
            frame=window.target_frame,
            time=shown_time(window.target_stamp_ns),
            pictures=pictures,
            legend=_legend(grids, theirs),
        )


def _pictures(contest: Contest, grids: dict[str, NDArray[np.generic]], rivals: dict[str, Grid]) -> Iterable[Picture]:
    inputs = np.asarray(grids["inputs"], np.uint8)
    target, prediction = np.asarray(grids["target"], np.uint8), np.asarray(grids["prediction"], np.uint8)
    mask = np.asarray(grids["mask"], np.bool_)
    sensors, steps = inputs.shape[:2]
    for t in range(steps):
        for s in range(sensors):
            title = f"Input {t + 1} of {steps}" + (f", {_sensor(contest, s)}" if sensors > 1 else "")
            yield Picture(title, f"{title}, aligned to the target", data_uri(grid_png(inputs[s, t])), step=True)
    yield Picture("Target", "Target grid with mask M in white", data_uri(grid_png(target, mask)), step=True)
    name = contest.model.name
    yield Picture(name, f"Prediction of {name}", data_uri(grid_png(prediction)), step=True)
    for rival, grid in rivals.items():
        yield Picture(rival, f"Prediction of {rival}", data_uri(grid_png(grid)))
    for rival, grid in list(rivals.items())[:1]:
        alt = f"Cells where {name} or {rival} is right"
        yield Picture("Who is right", alt, data_uri(right_png(target, prediction, grid, mask)))
    certainty = np.asarray(grids["certainty"], np.uint8)
    if certainty.min() == certainty.max():
        return  # a baseline is equally certain of everything
    yield Picture("Certainty", f"Certainty of {name}, light is certain", data_uri(certainty_png(certainty)))


def _legend(grids: dict[str, NDArray[np.generic]], rivals: dict[str, Grid]) -> tuple[tuple[str, str], ...]:
    """Name the classes that appear in an example, and M."""
    drawn = [grids["inputs"], grids["target"], grids["prediction"], *rivals.values()]
    there = np.unique(np.concatenate([np.unique(grid) for grid in drawn]))
    return (*(CLASS_LEGEND[int(i)] for i in there), MASK_LEGEND)


def _sensor(contest: Contest, index: int) -> str:
    sensors = contest.model.record.sensors
    return sensors[index] if index < len(sensors) else f"sensor {index + 1}"


def _rival_predictions(result: Result, rival: Result, at: Sequence[int]) -> list[Grid | None]:
    places = positions(rival)
    found = [places.get(key_of(result.record.windows[i])) for i in at]
    there = [i for i in found if i is not None]
    grids = iter(_read(rival.folder / PREDICTIONS_FILE, ("prediction",), there)["prediction"]) if there else iter(())
    return [None if i is None else np.asarray(next(grids), np.uint8) for i in found]


def _read(path: Path, names: tuple[str, ...], at: Sequence[int]) -> dict[str, NDArray[np.generic]]:
    arrays = read_arrays(path, names)
    return {name: array[list(at)] for name, array in arrays.items()}
