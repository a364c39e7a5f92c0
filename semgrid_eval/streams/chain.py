"""Measures a perception chain on this machine: frames of recorded logs, one after another, after a warm-up."""

import os
import platform
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import cv2
import torch

import semgrid_eval
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.grids.build import build_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.models.device import choose_device, cpu_facts, settle_process
from semgrid_eval.progress import Progress, silent
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.network import SegmentationNetwork
from semgrid_eval.streams.laps import Clock, Laps, Measured
from semgrid_eval.streams.live import GIVEN, GRID, WINDOW, Chain, LiveLog, grid_of
from semgrid_eval.streams.profile import LatencyProfile, MadeBy
from semgrid_eval.streams.untrained import TimedModel, timed_model
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import training_windows
from semgrid_eval.words import plural


@dataclass(frozen=True)
class Amount:
    """How much is measured."""

    frames: int = 300  # at most
    warm_up: int = 20  # whole frames before them, in which compilers, caches and the device settle


@dataclass(frozen=True)
class Parts:
    """What a chain is to be made of."""

    models: tuple[str, ...] = ()  # as `find_model` knows them
    segment: Path | None = None  # ONNX file of a segmentation network
    segmentation: SegmentationConfig = field(default_factory=SegmentationConfig)  # how it is used
    right: Path | None = None  # folder of right images, as `RightImages` says
    camera: str | None = None  # whose frames are taken; else those of a log's only one with disparity
    device: str = "auto"  # of networks and grids
    threads: int | None = None  # of torch, OpenCV and ONNX Runtime; None leaves them what they are
    processor_time: bool = False  # whether that is counted, which other work on the machine does not change

    @property
    def clock(self) -> Clock:
        """The clock that times are taken from."""
        return time.process_time_ns if self.processor_time else time.perf_counter_ns


@dataclass(frozen=True)
class Built:
    """A chain that can be measured."""

    chain: Chain
    random: tuple[str, ...]  # models whose weights are random


def build_chain(logs: Sequence[Path], parts: Parts) -> Built:
    """Load, or make, what a chain is made of; this sets the threads of the process.

    Raises:
        InputError: a model, the network or the device cannot be used.
        MissingExtraError: ONNX Runtime is not installed, and a network is given.
    """
    settle_process()
    if parts.threads is not None:
        torch.set_num_threads(parts.threads)
        cv2.setNumThreads(parts.threads)
    device = choose_device(parts.device)
    if parts.processor_time and (device.type != "cpu" or parts.threads != 1):
        raise ConfigError("is what a chain takes on one thread of a CPU alone: add --threads 1", field="processor_time")
    made = models_for(parts.models, logs[0], device, parts.camera)
    segmentation = None
    if parts.segment is not None:
        segmentation = SegmentationNetwork(
            parts.segment, parts.segmentation, device=parts.device, threads=parts.threads
        )
    chain = Chain({each.name: each.model for each in made}, device, segmentation, parts.right, parts.camera)
    return Built(chain, tuple(each.name for each in made if each.is_random))


def models_for(names: Sequence[str], log: Path, device: torch.device, camera: str | None = None) -> list[TimedModel]:
    """Make models; what has to learn something learns it from one log."""

    @cache
    def windows() -> WindowSet:
        data = stack_recordings(build_log(log, grid_of(camera)), cell_m=GRID.spec.cell_m)
        return select_windows(data, training_windows(data.frame_counts, WINDOW).windows, sensors=GIVEN.sensors)

    return [timed_model(name, GIVEN, device, windows) for name in dict.fromkeys(names)]


def measure_chain(
    logs: Sequence[Path],
    chain: Chain,
    amount: Amount,
    *,
    clock: Clock = time.perf_counter_ns,
    progress: Progress = silent,
) -> Measured:
    """Put the frames of logs through a chain, one log after another, and return what each stage took.

    A frame counts when the chain has as many grids as models see, which at the beginning of a log it has not, and when
    the warm-up is over.

    Raises:
        LogError: a log is damaged or lacks what the chain needs.
        InputError: no frame is left to be measured, or a network or a model fails.
    """
    found, whole = Measured(), 0
    for path in logs:
        with LogReader(path) as log:
            for laps in _laps(log, chain, clock):
                whole += 1
                if whole > amount.warm_up:
                    found.add(laps)
                    progress(found.frames, amount.frames, path.stem)
                if found.frames == amount.frames:
                    return found
    if not found.frames:
        seen = f"the logs hold {plural(whole, 'frame')} with all inputs ({WINDOW.span_frames} frames back)"
        raise InputError(f"{amount.warm_up} leaves no frame to measure: {seen}; give more logs", field="warm_up")
    return found


def _laps(log: LogReader, chain: Chain, clock: Clock) -> Iterator[Laps]:
    live = LiveLog(log, chain)
    for number, frame in enumerate(log.frames(live.camera, images=live.needs_colour)):
        laps = Laps(chain.device, clock)
        if live.take(frame, number, laps):
            yield laps


def profile_of(
    measured: Measured, device: torch.device, command: str, *, processor_time: bool = False
) -> LatencyProfile:
    """Return what was measured as a profile that says where, and by which clock."""
    here = machine(device) | ({"clock": "processor time"} if processor_time else {})
    made_by = MadeBy(command=command, version=semgrid_eval.__version__, machine=here)
    stages, models = (
        {name: tuple(samples) for name, samples in each.items()} for each in (measured.stages, measured.models)
    )
    return LatencyProfile(format=1, made_by=made_by, stages=stages, models=models)


def machine(device: torch.device) -> dict[str, str]:
    """Describe this machine, without its name."""
    found = {
        "processor": cpu_facts().get("model name") or platform.processor() or platform.machine(),
        "cores": str(os.cpu_count()),
        "threads": str(torch.get_num_threads()),
        "device": str(device),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "torch": torch.__version__,
    }
    return found | ({"gpu": torch.cuda.get_device_name(device)} if device.type == "cuda" else {})
