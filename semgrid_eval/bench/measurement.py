"""What a benchmark of speed reports, and how it takes time: the median of several repeats."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    repeats: int = 3  # of each measurement; their median counts
    town_size_m: float = 450.0  # side of the town that is built
    duration_s: float = 90.0  # simulated time of it
    scale: float = 1.0  # of the images' width and height
    features: tuple[int, ...] = (16, 32, 64)  # of the encoder-decoders that are trained
    batch: int = 8  # windows of an update
    updates: int = 4  # in each repeat
    windows: int = 64  # that are predicted and scored in each repeat
    matrix_rows: int = 2048  # of the square matrices whose product tells the machine's rate


FULL = Settings()
QUICK = Settings(repeats=1, features=(16,), updates=3, windows=32)


@dataclass(frozen=True)
class Measurement:
    """One measured number."""

    what: str  # was measured, in a few words
    value: float  # the median
    unit: str  # of the value; `s CPU` is processor time, that of SUMO's tools included
    at_most: float | None = None  # what is promised, None where nothing is

    @property
    def kept(self) -> bool | None:
        """Whether the promise is kept; None without one."""
        return None if self.at_most is None else self.value <= self.at_most


def wall_s(work: Callable[[], object], repeats: int) -> float:
    """Return the median time that passes while `work` is done."""
    return median(_elapsed(time.perf_counter, work) for _ in range(repeats))


def processor_s(work: Callable[[], object], repeats: int) -> float:
    """Return the median processor time of `work`, that of processes which it starts and waits for included."""
    return median(_elapsed(_processor_clock_s, work) for _ in range(repeats))


def _elapsed(clock: Callable[[], float], work: Callable[[], object]) -> float:
    start_s = clock()
    work()
    return clock() - start_s


def _processor_clock_s() -> float:
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system
