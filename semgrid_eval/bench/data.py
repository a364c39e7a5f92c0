"""Measures the way from a simulated town to grids: building, rendering, logs, rasterising.

The town, a recording and a log of it are made when they are first asked for.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path

import cv2

from semgrid_eval.bench.measurement import Measurement, Settings, processor_s, wall_s
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.check import check_log
from semgrid_eval.log.store import read_recording, write_log
from semgrid_eval.progress import silent
from semgrid_eval.recording.types import Recording
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.config import FRAME_COUNT, SyntheticConfig
from semgrid_eval.sources.town.kinds import KINDS
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan, render_recording
from semgrid_eval.sources.town.town import TownSpec, prepare_town

TOWN_AT_MOST_S = 60.0
_RENDERED: tuple[tuple[Stereo, int, int, float], ...] = (
    ("exact", 512, 256, 1.8),
    ("modelled", 512, 256, 1.8),
    ("matched", 1024, 512, 12.0),
)
"""Stereo, width and height, and the promised seconds of one core for a recording."""
_MEGABYTE = 1e6


class Material:
    """Inputs of the measurements; towns and logs lie in `folder`."""

    def __init__(self, folder: Path, settings: Settings) -> None:
        self.folder, self.settings = folder, settings

    def plan(self, stereo: Stereo, width_px: int, height_px: int) -> RecordingPlan:
        """Plan a recording in the town, which is built once; the size is scaled as the settings say."""
        scale = self.settings.scale
        config = SyntheticConfig(
            recordings=1,
            towns=1,
            val_share=0.0,
            stereo=stereo,
            width=round(width_px * scale),
            height=round(height_px * scale),
            town_size_m=self.settings.town_size_m,
            duration_s=self.settings.duration_s,
        )
        return plan_recordings(config, self.folder / "towns", silent)[0]

    @cached_property
    def recording(self) -> Recording:
        """A rendered recording of modelled stereo, its frames in memory."""
        recording = render_recording(self.plan("modelled", 512, 256))
        moments = tuple(recording.moments())
        return replace(recording, moments=lambda: iter(moments))

    @cached_property
    def log(self) -> Path:
        """The log of that recording."""
        path = self.folder / "recording.mcap"
        write_log(self.recording, path)
        return path


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
    for stereo, width_px, height_px, at_most_s in _RENDERED:
        plan = material.plan(stereo, width_px, height_px)
        _render(replace(plan, width_px=64, height_px=32))  # loads and compiles what the first rendering needs
        with _one_thread():
            seconds = processor_s(partial(_render, plan), material.settings.repeats)
        what = f"{FRAME_COUNT} frames, {plan.width_px} x {plan.height_px}, {stereo}"
        yield Measurement(what, seconds, "s CPU", at_most_s)


def measure_logs(material: Material) -> Iterator[Measurement]:
    """Write a log from frames in memory, read all of it, and check it."""
    repeats, path = material.settings.repeats, material.folder / "written.mcap"
    seconds = {"written": wall_s(lambda: write_log(material.recording, path), repeats)}
    seconds["read"] = wall_s(lambda: sum(1 for _ in read_recording(path).moments()), repeats)
    seconds["checked"] = wall_s(lambda: check_log(path), repeats)
    megabytes = path.stat().st_size / _MEGABYTE
    for what, took_s in seconds.items():
        yield Measurement(f"log of {megabytes:.1f} MB {what}", megabytes / took_s, "MB/s")


def measure_grids(material: Material) -> Iterator[Measurement]:
    """Make the grids of a log, of the whole image alone and with the crops of both splits."""
    for config in (GridConfig(sensors={"full": CameraSensor()}), GridConfig()):
        build_log(material.log, config)  # compiles
        took_s = wall_s(partial(build_log, material.log, config), material.settings.repeats)
        count = len(config.sensors)
        yield Measurement(f"grids of {count} sensor{'s' * (count > 1)}", FRAME_COUNT / took_s, "frames/s")


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
