"""Measures what grows with what: processor time of each stage against recordings, cells, classes, sensors and lead."""

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from semgrid_eval.bench.measurement import processor_s
from semgrid_eval.bench.networks import RESIDUAL, Subject, encoder_decoder, random_windows
from semgrid_eval.classes import DEFAULT_CLASSES, Category, ClassSet, GridClass
from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.grids.build import build_grids
from semgrid_eval.grids.spec import GridConfig, GridSpec, paper_sensors
from semgrid_eval.log.store import read_recording, write_log
from semgrid_eval.models.encoder_decoder import EncoderDecoder, EncoderDecoderSettings
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import Network, seeded_network
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.training import train
from semgrid_eval.scores.evaluate import evaluate
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows
from semgrid_eval.words import plural

CPU = torch.device("cpu")
EXTENT_M = 100.0
BATCH, SCORED_A_RECORDING = 8, 8


@dataclass(frozen=True)
class Point:
    """What is built, trained and scored."""

    recordings: int = 4
    side: int = 128  # cells along each side of a grid, all of the same 100 m
    classes: int = 10
    sensors: int = 1
    lead: int = 5  # frames

    @property
    def grid(self) -> GridConfig:
        """How its grids are made."""
        side, sensors = self.side, paper_sensors()
        spec = GridSpec(rows=side, columns=side, cell_m=EXTENT_M / side, agent_row=side, agent_column=side // 2)
        chosen = {name: sensors[name] for name in list(sensors)[: self.sensors]}
        return GridConfig(spec=spec, sensors=chosen, classes=class_set(self.classes))


AXES: dict[str, tuple[int, ...]] = {
    "recordings": (1, 2, 4, 8),
    "side": (32, 64, 128, 256),
    "classes": (3, 5, 10, 20),
    "sensors": (1, 2, 3, 5),
    "lead": (1, 5, 10, 20),
}
QUICK: dict[str, tuple[int, ...]] = {"recordings": (1, 2), "side": (32, 64)}


@dataclass(frozen=True)
class Size:
    """How much is done at each point."""

    axes: dict[str, tuple[int, ...]]
    updates: int = 2
    features: int = 16
    repeats: int = 1  # the median counts
    priced: tuple[int, ...] = (32, 64)  # features of the networks whose windows are priced


FULL, SMALL = Size(AXES), Size(QUICK, updates=1, features=2, repeats=1, priced=(2,))


def class_set(count: int) -> ClassSet:
    """Return a set of so many classes, `unknown` included, which share out the labels of the default set."""
    if count == DEFAULT_CLASSES.count:
        return DEFAULT_CLASSES
    labels = [label for entry in DEFAULT_CLASSES.classes for label in entry.labels]
    parts = [labels[i :: count - 1] for i in range(count - 1)]
    colours = [(10 * i, 255 - 10 * i, 5 * i) for i in range(count)]
    known = [
        GridClass(name=f"class_{i}", category="all", colour=colours[i], labels=tuple(part))
        for i, part in enumerate(parts, start=1)
    ]
    unknown = GridClass(name="unknown", category="all", colour=colours[0])
    return ClassSet(categories=(Category(name="all"),), classes=(unknown, *known))


class Stages:
    """The stages of a run at one point, each of which can be timed alone."""

    def __init__(self, point: Point, logs: Sequence[Path], folder: Path, size: Size) -> None:
        self._point, self._logs, self._folder, self._size = point, logs[: point.recordings], folder, size
        self._grid = point.grid
        built = build_grids(self._logs, folder / "first", self._grid)
        if built.failed:
            raise InputError(next(iter(built.failed.values())))
        spec, names = self._grid.spec, list(self._grid.sensors)
        data = stack_recordings(built.recordings, cell_m=spec.cell_m, classes=self._grid.classes, sensors=names)
        window = WindowConfig(step_frames=1, horizon_steps=point.lead)
        planned = training_windows(data.frame_counts, window).windows
        places = np.linspace(0, len(planned) - 1, SCORED_A_RECORDING * point.recordings).round().astype(int)
        self._windows: WindowSet = select_windows(data, planned[places], sensors=names)
        self._given = Given(
            tuple(names), window.inputs, spec.rows, spec.columns, spec.cell_m, True, classes=self._grid.classes
        )
        self.work: dict[str, Callable[[], object]] = {
            "log written": self._write,
            "grids": self._build,
            f"training, {size.updates} updates": self._train,
            "prediction": self._predict,
            "scoring": self._score,
        }

    def _write(self) -> None:
        for log in self._logs:
            with tempfile.TemporaryDirectory(dir=self._folder) as folder:
                write_log(read_recording(log), Path(folder) / log.name)

    def _build(self) -> None:
        with tempfile.TemporaryDirectory(dir=self._folder) as folder:
            build_grids(self._logs, Path(folder), self._grid)

    def _network(self) -> Network:
        updates, batch = self._size.updates, BATCH
        training = {"epochs": 1, "updates_per_epoch": updates, "batch": batch, "precision": "float32"}
        settings = EncoderDecoderSettings(features=self._size.features, training=training)  # type: ignore[arg-type]
        return seeded_network(EncoderDecoder, settings, self._given, 0)

    def _train(self) -> None:
        with tempfile.TemporaryDirectory(dir=self._folder) as folder:
            train(self._network(), self._windows, seed=0, device=CPU, folder=Path(folder))

    def _predict(self) -> None:
        network = self._network().eval()
        for batch in self._windows.batches(16):
            network.predict(batch)

    def _score(self) -> None:
        evaluate(RepeatNewest(Config(), self._given), self._windows, spec=self._grid.spec)


def measured(logs: Sequence[Path], size: Size) -> Iterator[dict[str, Any]]:
    """Measure all stages at all points: a record each."""
    needed = max(size.axes["recordings"])
    if len(logs) < needed:
        raise InputError(f"holds {plural(len(logs), 'log')}, and {needed} are needed", field="logs")
    with tempfile.TemporaryDirectory() as name:
        for work in Stages(Point(recordings=1), logs, Path(name, "warm"), size).work.values():
            work()  # compiles
        for axis, values in size.axes.items():
            for value in values:
                point = replace(Point(), **{axis: value})
                stages = Stages(point, logs, Path(name, f"{axis}{value}"), size)
                for stage, work in stages.work.items():
                    yield {"axis": axis, "stage": stage, **asdict(point), "cpu_s": processor_s(work, size.repeats)}


def prices(size: Size) -> dict[str, float]:
    """Measure the processor seconds that a window of one update takes with networks of the matrices."""
    subjects = [*map(encoder_decoder, size.priced), RESIDUAL]
    return {subject.name: window_s(subject, size.repeats) for subject in subjects}


def window_s(subject: Subject, repeats: int) -> float:
    """Measure the processor seconds of one window of an update, batch 8, without what a training does once."""

    def work(updates: int) -> None:
        network = subject.network(epochs=1, updates_per_epoch=updates, batch=BATCH, precision="float32")
        with tempfile.TemporaryDirectory() as folder:
            train(network, random_windows(), seed=0, device=CPU, folder=Path(folder))

    few, more = 1, 3
    work(few)
    spent_s = {updates: processor_s(partial(work, updates), repeats) for updates in (few, more)}
    return (spent_s[more] - spent_s[few]) / (more - few) / BATCH


def exponents(points: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Fit the power of each quantity with which each stage grows, by least squares of the logarithms."""
    found: dict[str, dict[str, float]] = {}
    for stage in dict.fromkeys(point["stage"] for point in points):
        for axis in dict.fromkeys(point["axis"] for point in points):
            amounts, seconds = curve(points, axis, stage)
            slope = np.polyfit(np.log(amounts), np.log(seconds), 1)[0]
            found.setdefault(stage, {})[axis] = round(float(slope), 2)
    return found


def curve(points: Sequence[dict[str, Any]], axis: str, stage: str) -> tuple[list[float], list[float]]:
    """Return the amounts of a quantity and the processor seconds of a stage with them."""
    chosen = [point for point in points if point["axis"] == axis and point["stage"] == stage]
    amounts = [float(point[axis] ** 2 if axis == "side" else point[axis]) for point in chosen]
    return amounts, [point["cpu_s"] for point in chosen]
