"""What a benchmark of speed reports, and how it takes time: the median of several repeats."""

import multiprocessing
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from statistics import median
from typing import TypeVar

from semgrid_eval.recording.colour import ImageSize

T = TypeVar("T")


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    repeats: int = 3  # of each measurement; their median counts
    town_size_m: float = 450.0  # side of the town that is built
    duration_s: float = 90.0  # simulated time of it
    scale: float = 1.0  # of the width and height of what is rendered
    features: tuple[int, ...] = (16, 32, 64)  # of the encoder-decoders that are trained
    batch: int = 8  # windows of an update
    updates: int = 4  # in each repeat
    windows: int = 64  # that are predicted and scored in each repeat
    matrix_rows: int = 2048  # of the square matrices whose product tells the machine's rate
    pictures_px: tuple[ImageSize, ...] = (ImageSize(512, 256), ImageSize(2048, 1024))  # of cameras in logs
    recordings: int = 16  # whose conversion and grids are shared by `workers`
    workers: int = 2  # processes at once
    trained_recordings: tuple[int, ...] = (300, 30_000)  # of which a network learns
    reported: tuple[int, int, int] = (18, 20, 500)  # rows, repeats and recordings of the run that is reported


FULL = Settings()
QUICK = Settings(
    repeats=1,
    features=(16,),
    updates=3,
    windows=32,
    pictures_px=(ImageSize(512, 256),),
    recordings=4,
    trained_recordings=(300,),
    reported=(6, 4, 100),
)


@dataclass(frozen=True)
class Measurement:
    """One measured number."""

    what: str  # was measured, in a few words
    value: float  # the median
    unit: str  # of the value; `s CPU` is processor time, that of started processes included
    at_most: float | None = None  # the goal, None where it is not an upper bound
    at_least: float | None = None  # the goal, None where it is not a lower bound

    @property
    def goal(self) -> str:
        """What was to be reached, in words; empty where nothing was."""
        if self.at_most is not None:
            return f"at most {self.at_most:g}"
        return "" if self.at_least is None else f"at least {self.at_least:g}"

    @property
    def is_short(self) -> bool:
        """Whether there is a goal and it is not reached."""
        above = self.at_most is not None and self.value > self.at_most
        return above or (self.at_least is not None and self.value < self.at_least)


def processor_clock_s() -> float:
    """Return the processor time of this process so far, that of processes which it has waited for included."""
    waited_for = os.times()
    return time.process_time() + waited_for.children_user + waited_for.children_system


seconds_passed = time.perf_counter
"""The clock that a user waits by."""


def wall_s(work: Callable[[], object], repeats: int) -> float:
    """Return the median time that passes while `work` is done."""
    return median(_elapsed(seconds_passed, work) for _ in range(repeats))


def processor_s(work: Callable[[], object], repeats: int) -> float:
    """Return the median processor time of `work`, that of processes which it starts and waits for included."""
    return median(_elapsed(processor_clock_s, work) for _ in range(repeats))


def times_as_fast(
    ours: Callable[[], object],
    rival: Callable[[], object],
    repeats: int,
    *,
    clock: Callable[[], float] = processor_clock_s,
) -> float:
    """Return how many times as long the rival takes: both in turn, the median of the pairs.

    Whatever else the machine does meets both alike. `clock` gives seconds.
    """
    return median(_elapsed(clock, rival) / _elapsed(clock, ours) for _ in range(repeats))


def apart(work: Callable[[], T]) -> T:
    """Do `work`, which must be picklable, in a new process: what others did before counts as no memory of it."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(work).result()


def _elapsed(clock: Callable[[], float], work: Callable[[], object]) -> float:
    start_s = clock()
    work()
    return clock() - start_s
