"""The parts of the benchmark of speed, and what it is run on."""

import os
import platform
import tempfile
from collections.abc import Sequence
from pathlib import Path

import torch

from semgrid_eval.bench import cells, data, logs, memory, networks, whole
from semgrid_eval.bench.material import Material
from semgrid_eval.bench.measurement import Measurement, Settings
from semgrid_eval.errors import ConfigError
from semgrid_eval.faults import not_one_of
from semgrid_eval.models.device import cpu_facts
from semgrid_eval.progress import Progress, silent
from semgrid_eval.runs.record import machine, versions

_OF_MATERIAL = {
    "start": data.measure_start,
    "town": data.measure_town,
    "render": data.measure_rendering,
    "convert": logs.measure_conversion,
    "logs": logs.measure_logs,
    "grids": cells.measure_grids,
    "cells": cells.measure_cells,
    "memory": memory.measure_memory,
    "report": whole.measure_report,
    "demo": whole.measure_demo,
}
_OF_NETWORKS = {"training": networks.measure_training, "prediction": networks.measure_prediction}
_LONG = ("memory", "report", "demo")
USUAL = (*(part for part in _OF_MATERIAL if part not in _LONG), *_OF_NETWORKS)
"""What is measured where no part is asked for."""
PARTS = (*USUAL, *_LONG)


def measure(
    parts: Sequence[str], settings: Settings, *, device: torch.device, progress: Progress = silent
) -> dict[str, list[Measurement]]:
    """Measure parts of `PARTS` in their order, in this process; memory, report and demo in processes of their own.

    Raises:
        ConfigError: a part is not known.
        InputError: SUMO failed.
        MissingExtraError: SUMO or Embree is not installed, and a part needs them.
    """
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        raise ConfigError(not_one_of(unknown[0], PARTS), field="only")
    chosen = [part for part in PARTS if part in parts]
    found: dict[str, list[Measurement]] = {}
    with tempfile.TemporaryDirectory(prefix="semgrid-bench-") as folder:
        material = Material(Path(folder), settings)
        for part in chosen:
            progress(len(found), len(chosen), part)
            of_network = _OF_NETWORKS.get(part)
            found[part] = list(of_network(settings, device) if of_network else _OF_MATERIAL[part](material))
    progress(len(chosen), len(chosen), "done")
    return found


def conditions(device: torch.device) -> dict[str, str]:
    """Return what the numbers hold for: processor, cores, threads, device, other work at this moment and versions."""
    return {
        "processor": cpu_facts().get("model name") or platform.processor() or platform.machine(),
        "load": f"{load():.1f}",
        **machine(device, torch.get_num_threads()),
        **versions(),
    }


def load() -> float:
    """Return how many processes wanted to run during the last minute; 0 where the system does not say."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
