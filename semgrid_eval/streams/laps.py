"""Takes the time of what a chain does, frame by frame."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import torch

_MS_PER_NS = 1e-6
_DIGITS = 6  # of milliseconds: whole nanoseconds
Clock = Callable[[], int]
"""Nanoseconds from any beginning."""


class Laps:
    """What one frame took, in milliseconds, by stage and by model."""

    def __init__(self, device: torch.device, clock: Clock = time.perf_counter_ns) -> None:
        self._device, self._clock = device, clock
        self.stages: dict[str, float] = {}
        self.models: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Take the time of a stage, until the device is done with it."""
        start_ns = self._clock()
        yield
        self.stages[name] = self._since(start_ns)

    @contextmanager
    def model(self, name: str) -> Iterator[None]:
        """Take the time of a model, likewise."""
        start_ns = self._clock()
        yield
        self.models[name] = self._since(start_ns)

    def _since(self, start_ns: int) -> float:
        if self._device.type == "cuda":  # it works on while Python goes on
            torch.cuda.synchronize(self._device)
        return round((self._clock() - start_ns) * _MS_PER_NS, _DIGITS)


@dataclass
class Measured:
    """What many frames took: milliseconds (N,) by stage and by model, as a profile has them."""

    stages: dict[str, list[float]] = field(default_factory=dict)
    models: dict[str, list[float]] = field(default_factory=dict)
    frames: int = 0

    def add(self, laps: Laps) -> None:
        """Add a frame."""
        self.frames += 1
        for samples, taken in ((self.stages, laps.stages), (self.models, laps.models)):
            for name, took_ms in taken.items():
                samples.setdefault(name, []).append(took_ms)
