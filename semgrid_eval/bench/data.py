"""Measures what comes before logs: the start of a command, towns, rendered recordings."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import cv2

from semgrid_eval.bench.material import Material
from semgrid_eval.bench.measurement import Measurement, processor_s
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.config import FRAME_COUNT
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.rendering import RecordingPlan, render_recording
from semgrid_eval.sources.town.town import TownSpec, prepare_town

START_AT_MOST_S = 0.15
TOWN_AT_MOST_S = 60.0
_RENDERED: tuple[tuple[Stereo, int, int, float], ...] = (
    ("exact", 512, 256, 1.2),
    ("modelled", 512, 256, 1.2),
    ("matched", 1024, 512, 12.0),
)
"""Stereo, width and height, and the goal in seconds of one core for a recording."""


def measure_start(material: Material) -> Iterator[Measurement]:
    """Start Python alone, and to the list of commands."""
    commands = {"python -c pass": ["-c", "pass"], "semgrid-eval --help": ["-m", "semgrid_eval", "--help"]}
    for what, arguments in commands.items():
        start = partial(subprocess.run, [sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
        start()  # reads it from the disk
        at_most_s = None if "-c" in arguments else START_AT_MOST_S
        yield Measurement(what, processor_s(start, 3 * material.settings.repeats), "s CPU", at_most_s)


def measure_town(material: Material) -> Iterator[Measurement]:
    """Build a town with its traffic, each time from the start."""
    settings, folder = material.settings, material.folder / "measured-towns"
    spec = TownSpec(0, KINDS[0].name, 0, settings.town_size_m, settings.duration_s)

    def build() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        prepare_town(spec, folder)

    what = f"{spec.kind}, {spec.size_m:g} m, {spec.duration_s:g} s of traffic"
    yield Measurement(what, processor_s(build, settings.repeats), "s CPU", TOWN_AT_MOST_S)


def measure_rendering(material: Material) -> Iterator[Measurement]:
    """Render a recording with each kind of stereo."""
    scale = material.settings.scale
    for stereo, width_px, height_px, at_most_s in _RENDERED:
        plan = material.plan(stereo, ImageSize(round(width_px * scale), round(height_px * scale)))
        _render(replace(plan, width_px=64, height_px=32))  # loads and compiles what the first rendering needs
        with _one_thread():
            seconds = processor_s(partial(_render, plan), material.settings.repeats)
        what = f"{FRAME_COUNT} frames, {plan.width_px} x {plan.height_px}, {stereo}"
        yield Measurement(what, seconds, "s CPU", at_most_s)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let OpenCV work in one thread inside the block, as it does in each of several workers."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _render(plan: RecordingPlan) -> None:
    for _ in render_recording(plan).moments():
        pass
