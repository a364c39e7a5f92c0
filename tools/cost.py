"""Measure what costs what: processor seconds of each stage against recordings, cells, classes, sensors and lead.

One quantity is changed at a time, all else is the paper's (128 x 128 cells, 10 classes, one sensor, 5 frames ahead)
over a few recordings. Processor time is measured, in one thread, so that a busy machine tells nearly the same. Writes
OUT/cost.json and OUT/cost.svg, and prints the exponents and the hours of whole matrices in Markdown.

Example: python tools/cost.py build/logs --out docs
         python tools/cost.py --drawn docs/cost.json --out docs
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np
import torch
from matplotlib.figure import Figure

from semgrid_eval.bench.measurement import processor_s
from semgrid_eval.bench.networks import RESIDUAL, Subject, encoder_decoder, random_windows
from semgrid_eval.classes import DEFAULT_CLASSES, Category, ClassSet, GridClass
from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.files import read_json, write_json, write_text
from semgrid_eval.grids.build import build_grids
from semgrid_eval.grids.spec import GridConfig, GridSpec, paper_sensors
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import NetworkSettings, seeded_network
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.registry import described
from semgrid_eval.models.training import train
from semgrid_eval.report.claims.claims import in_paper
from semgrid_eval.report.figures.style import SETTINGS, finish, line_style
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.record import machine
from semgrid_eval.runs.row import Row, plan_units
from semgrid_eval.scores.evaluate import evaluate
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

CPU = torch.device("cpu")
EXTENT_M = 100.0
BATCH, SCORED_A_RECORDING = 8, 8
RECORDINGS, VALIDATED = 420, 120
"""Of town-v1 small: all, and those that are scored, in one window each."""
RATES = Path(__file__).resolve().parent.parent / "reports" / "gpu"
FLAT, NEARLY = 0.15, 0.85
"""Exponents below the first are called flat, from the second on linear."""


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
    "recordings": (2, 4, 8, 16),
    "side": (32, 64, 128, 256),
    "classes": (3, 5, 10, 20),
    "sensors": (1, 2, 3, 5),
    "lead": (1, 5, 10, 20),
}
QUICK: dict[str, tuple[int, ...]] = {"recordings": (1, 2), "side": (32, 64)}
WORDS = {"recordings": "recordings", "side": "cells of a grid", "classes": "classes", "sensors": "sensors",
         "lead": "lead, frames"}  # fmt: skip


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
        self._windows: WindowSet = select_windows(data, [planned[i] for i in places], sensors=names)
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

    def _network(self) -> Any:  # noqa: ANN401 - a network
        updates, batch = self._size.updates, BATCH
        training = {"epochs": 1, "updates_per_epoch": updates, "batch": batch, "precision": "float32"}
        settings = EncoderDecoderSettings(features=self._size.features, training=training)  # type: ignore[arg-type]
        return seeded_network(encoder_decoder(16).kind, settings, self._given, 0)

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
        raise InputError(f"holds {len(logs)} logs, and {needed} are needed", field="logs")
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
    """Measure the processor seconds of one window of an update, batch 8."""
    network = subject.network(epochs=1, updates_per_epoch=1, batch=BATCH, precision="float32")

    def work() -> None:
        with tempfile.TemporaryDirectory() as folder:
            train(network, random_windows(), seed=0, device=CPU, folder=Path(folder))

    work()
    return processor_s(work, repeats) / BATCH


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


def hours(found: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Work out the hours of whole matrices on town-v1 small from what was measured here, and on a GPU."""
    spent = {(point["stage"], point["axis"], point["sensors"], point["recordings"]): point for point in found["points"]}
    grids = max(
        (p for p in spent.values() if p["stage"] == "grids" and p["axis"] == "sensors"), key=lambda p: p["sensors"]
    )
    windows = SCORED_A_RECORDING * Point().recordings
    answered = {
        p["stage"]: p["cpu_s"] / windows for p in spent.values() if p["axis"] == "lead" and p["lead"] == Point().lead
    }
    scored_s = VALIDATED * (answered["prediction"] + answered["scoring"])
    table = {}
    for name, rows in matrices().items():
        units = [unit.row for unit in plan_units(rows, 0).values()]
        trainings = [parts for row in units if (parts := training_of(row)) is not None]
        trained_s = sum(windows * found["prices"][kind] for kind, windows in trainings)
        total_s = RECORDINGS * grids["cpu_s"] / grids["recordings"] + trained_s + len(units) * scored_s
        cores_h = {f"{count} cores": total_s / count / 3600 for count in (2, 16, 20)}
        table[name] = {"trainings": len(trainings), "trained_share": trained_s / total_s, **cores_h}
        rate = read_json(RATES / "rates.json")["figures"]["trained by the package"]["value"]
        table[name]["GPU"] = sum(windows for _, windows in trainings) / rate / 3600
    table["paper"]["GPU"] = read_json(RATES / "paper.json")["whole_preset"]["hours"]
    return table


def matrices() -> dict[str, list[Row]]:
    """Return the rows that hours are told of: all of `paper-cpu`, and the paper's own of `paper`."""
    paper = [row for row in load_matrix("paper").rows if in_paper(row.name)]
    return {"paper-cpu": list(load_matrix("paper-cpu").rows), "paper": paper}


def training_of(row: Row) -> tuple[str, int] | None:
    """Return the name of a row's network among the prices, and the windows of its training; None where it has none."""
    settings = described(row.model).parse_settings(row.settings)
    if not isinstance(settings, NetworkSettings):
        return None
    training = settings.training
    name = f"f {settings.features}" if isinstance(settings, EncoderDecoderSettings) else RESIDUAL.name
    return name, training.updates_until(training.epochs) * training.batch


def picture(points: Sequence[dict[str, Any]]) -> str:
    """Draw the cost of each stage over each quantity, against its least amount, as SVG."""
    axes = list(dict.fromkeys(point["axis"] for point in points))
    stages = list(dict.fromkeys(point["stage"] for point in points))
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(10.0, 2.9), layout="constrained")
        panels = figure.subplots(1, len(axes), sharey=True, squeeze=False)[0]
        for panel, axis in zip(panels, axes, strict=True):
            amounts, _ = curve(points, axis, stages[0])
            panel.plot(amounts, [each / amounts[0] for each in amounts], color="0.6", linestyle=":", label="linear")
            for number, stage in enumerate(stages):
                _, seconds = curve(points, axis, stage)
                shown = line_style(number) | {"marker": "o", "markersize": 3, "label": stage}
                panel.plot(amounts, [each / seconds[0] for each in seconds], **shown)
            panel.set(xlabel=WORDS[axis], xscale="log", yscale="log")
            panel.set_xticks(amounts, [f"{each:g}" for each in amounts], fontsize=7)
            panel.minorticks_off()
        panels[0].set(ylabel="processor time, times the first")
        panels[0].set_yticks([0.5, 1, 2, 4, 8, 16, 64], ["0.5", "1", "2", "4", "8", "16", "64"])
        figure.legend(
            *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(stages) + 1, fontsize=8
        )
        return finish(figure, "cost", "cost.json", "Processor time of each stage.").svg


def tables(found: dict[str, Any]) -> Iterator[str]:
    """Say in Markdown what grows with what, and how many hours whole matrices take."""
    axes = list(next(iter(found["exponents"].values())))
    yield f"| stage | {' | '.join(WORDS[axis] for axis in axes)} |"
    yield "|---|" + "---|" * len(axes)
    for stage, powers in found["exponents"].items():
        yield f"| {stage} | {' | '.join(in_words(powers[axis]) for axis in axes)} |"
    if "hours" in found:
        yield "\n| matrix | trainings | 2 cores | 16 cores | 10 machines of 2 cores | one H100 |"
        yield "|---|---|---|---|---|---|"
        for name, each in found["hours"].items():
            told = [f"{each[where]:.3g} h" for where in ("2 cores", "16 cores", "20 cores", "GPU")]
            yield f"| `{name}` | {each['trainings']} | {' | '.join(told)} |"


def in_words(power: float) -> str:
    """Name a power of a quantity."""
    kind = "flat" if abs(power) < FLAT else "linear" if NEARLY <= power <= 2 - NEARLY else "in between"
    return f"{kind} ({power:+.2f})"


def measure(logs: Path, *, quick: bool) -> dict[str, Any]:
    """Measure everything."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    size = SMALL if quick else FULL
    points = list(measured(find_logs(logs), size))
    found = {"machine": machine(CPU, 1), "points": points, "prices": prices(size), "exponents": exponents(points)}
    return found if quick else found | {"hours": hours(found)}


def main() -> int:
    """Measure, or draw what was measured, and write what was found."""
    top = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    top.add_argument("logs", type=Path, nargs="?", help="folder of 16 logs or more, of cameras")
    top.add_argument("--out", type=Path, required=True)
    top.add_argument("--quick", action="store_true", help="the least of everything, to try the tool itself")
    top.add_argument("--drawn", type=Path, help="what was measured before, instead of logs")
    chosen = top.parse_args()
    if chosen.drawn:
        found = read_json(chosen.drawn)
        found |= {"exponents": exponents(found["points"])} | ({"hours": hours(found)} if "hours" in found else {})
    elif chosen.logs:
        found = measure(chosen.logs, quick=chosen.quick)
    else:
        top.error("LOGS or --drawn is needed")
    write_json(chosen.out / "cost.json", found)
    write_text(chosen.out / "cost.svg", picture(found["points"]))
    sys.stdout.write("\n".join(tables(found)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
