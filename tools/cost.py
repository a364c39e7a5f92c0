"""Measure what costs what: processor seconds of each stage against recordings, cells, classes, sensors and lead.

One quantity is changed at a time, all else is the paper's (128 x 128 cells, 10 classes, one sensor, 5 frames ahead)
over a few recordings. Processor time is measured, in one thread, so that a busy machine tells nearly the same. Writes
OUT/cost.json and OUT/cost.svg, and prints the exponents and the hours of whole matrices in Markdown.

Example: python tools/cost.py build/logs --out docs
         python tools/cost.py --drawn docs/cost.json --out docs
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import matplotlib as mpl
import torch
from matplotlib.figure import Figure

from semgrid_eval.bench.growth import CPU, FULL, SCORED_A_RECORDING, SMALL, Point, curve, exponents, measured, prices
from semgrid_eval.bench.networks import RESIDUAL
from semgrid_eval.files import digest_value, read_json, write_json, write_text
from semgrid_eval.log.store import find_logs
from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.network import NetworkSettings
from semgrid_eval.models.registry import described
from semgrid_eval.report.claims.claims import in_paper
from semgrid_eval.report.figures.style import SETTINGS, finish, line_style
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.record import machine
from semgrid_eval.runs.row import Row, Unit, plan_units
from semgrid_eval.windows.plan import WindowConfig

RECORDINGS, VALIDATED = 420, 120
"""Of town-v1 small: all, and those that are scored, in one window each."""
RATES = Path(__file__).resolve().parent.parent / "reports" / "gpu"
NEARLY = 0.2
"""How far an exponent may be from 0 to be called flat, and from 1 to be called linear."""
WORDS = {"recordings": "recordings", "side": "cells of a grid", "classes": "classes", "sensors": "sensors",
         "lead": "lead, frames"}  # fmt: skip


def hours(found: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Work out the hours of whole matrices on town-v1 small from what was measured here, and on a GPU."""
    rate = read_json(RATES / "rates.json")["figures"]["trained by the package"]["value"]
    table = {}
    for name, rows in matrices().items():
        units = list(plan_units(rows, 0).values())
        trainings = [each for row in {learned(u): u.row for u in units}.values() if (each := training_of(row))]
        trained_s = sum(windows * found["prices"][kind] for kind, windows in trainings)
        total_s = RECORDINGS * grids_s(found["points"]) + trained_s + len(units) * VALIDATED * answer_s(found["points"])
        cores = {f"{count} cores": total_s / count / 3600 for count in (2, 16, 20)}
        gpu = sum(windows for _, windows in trainings) / rate / 3600
        table[name] = {"trainings": len(trainings), "trained_share": trained_s / total_s, **cores, "GPU": gpu}
    table["paper"]["GPU"] = read_json(RATES / "paper.json")["whole_preset"]["hours"]
    return table


def grids_s(points: Sequence[dict[str, Any]]) -> float:
    """Return the processor seconds of a recording's grids, of all sensors."""
    chosen = [point for point in points if point["axis"] == "sensors" and point["stage"] == "grids"]
    most = max(chosen, key=lambda point: int(point["sensors"]))
    return float(most["cpu_s"] / most["recordings"])


def answer_s(points: Sequence[dict[str, Any]]) -> float:
    """Return the processor seconds of a window predicted and scored, at the paper's lead."""
    usual = [point for point in points if point["axis"] == "lead" and point["lead"] == Point().lead]
    spent_s = sum(point["cpu_s"] for point in usual if point["stage"] in ("prediction", "scoring"))
    return float(spent_s / (SCORED_A_RECORDING * Point().recordings))


def matrices() -> dict[str, list[Row]]:
    """Return the rows that hours are told of: all of `paper-cpu`, and the paper's own of `paper`."""
    paper = [row for row in load_matrix("paper").rows if in_paper(row.name)]
    return {"paper-cpu": list(load_matrix("paper-cpu").rows), "paper": paper}


def learned(unit: Unit) -> str:
    """Return what one training is known by: rows for all leads share theirs, whatever lead each is scored at."""
    row = unit.row
    if row.train_leads:
        row = row.model_copy(update={"window": WindowConfig(inputs=row.window.inputs)})
    return digest_value([unit.seed, row.identity()])


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
    powers_of = exponents(found["points"])
    axes = list(next(iter(powers_of.values())))
    yield f"| stage | {' | '.join(WORDS[axis] for axis in axes)} |"
    yield "|---|" + "---|" * len(axes)
    for stage, powers in powers_of.items():
        yield f"| {stage} | {' | '.join(in_words(powers[axis]) for axis in axes)} |"
    if not found["quick"]:
        yield "\n| matrix | trainings | 2 cores | 16 cores | 10 machines of 2 cores | one H100 |"
        yield "|---|---|---|---|---|---|"
        for name, each in hours(found).items():
            told = [in_hours(each[where]) for where in ("2 cores", "16 cores", "20 cores", "GPU")]
            yield f"| `{name}` | {each['trainings']} | {' | '.join(told)} |"


def in_hours(hours: float) -> str:
    """Write hours with three digits, whole ones beyond that."""
    return f"{hours:,.0f} h" if hours >= 100 else f"{hours:.3g} h"


def in_words(power: float) -> str:
    """Name a power of a quantity."""
    kind = "flat" if abs(power) < NEARLY else "linear" if abs(power - 1) < NEARLY else "in between"
    return f"{kind} ({power:+.2f})"


def measure(logs: Path, *, quick: bool) -> dict[str, Any]:
    """Measure everything."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    size = SMALL if quick else FULL
    points = list(measured(find_logs(logs), size))
    return {"machine": machine(CPU, 1), "quick": quick, "points": points, "prices": prices(size)}


def main() -> int:
    """Measure, or take what was measured, and write what was found."""
    top = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    top.add_argument("logs", type=Path, nargs="?", help="folder of 8 logs or more, of cameras")
    top.add_argument("--out", type=Path, required=True)
    top.add_argument("--quick", action="store_true", help="the least of everything, to try the tool itself")
    top.add_argument("--drawn", type=Path, help="what was measured before, instead of logs")
    chosen = top.parse_args()
    if (chosen.drawn is None) == (chosen.logs is None):
        top.error("either LOGS or --drawn is needed")
    found = read_json(chosen.drawn) if chosen.drawn else measure(chosen.logs, quick=chosen.quick)
    write_json(chosen.out / "cost.json", found)
    write_text(chosen.out / "cost.svg", picture(found["points"]))
    sys.stdout.write("\n".join(tables(found)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
