"""The errors of one recording's pictures, from its random numbers: frame after frame, or branched and drawn again."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.noise import DisparityErrors, DisparityNoise, LabelErrors, LabelNoise

Generator = np.random.Generator
Float32s = NDArray[np.float32]
Labels = NDArray[np.uint8]


FRONT, LIDAR = "front", "top"
_OTHERS = ("left", "right", "rear", LIDAR)
_SENSORS = 5
"""Which child of a recording's generator all sensors but the front camera draw from."""


def recording_streams(seed: tuple[int, ...]) -> list[Generator]:
    """Return a recording's random numbers for: stamps, reported motion, sunlight, errors of the front camera."""
    return np.random.default_rng(seed).spawn(4)


def sensor_streams(seed: tuple[int, ...], sensor: str) -> list[Generator]:
    """Return the random numbers of a sensor, not the front camera, for: its stamps, its errors.

    They are its own, whichever other sensors there are.
    """
    of_sensors = np.random.default_rng(seed).spawn(_SENSORS + 1)[_SENSORS].spawn(len(_OTHERS))
    return of_sensors[_OTHERS.index(sensor)].spawn(2)


def error_stream(seed: tuple[int, ...], sensor: str) -> Generator:
    """Return the random numbers for the errors of any sensor."""
    return recording_streams(seed)[-1] if sensor == FRONT else sensor_streams(seed, sensor)[1]


@dataclass(frozen=True)
class Strengths:
    """How strong each kind of error is."""

    disparity: DisparityNoise = field(default_factory=DisparityNoise)
    label: LabelNoise = field(default_factory=LabelNoise)


@dataclass(frozen=True)
class PictureErrors:
    """The errors of labels and of modelled disparity after some frames; None where there are none.

    What they are in a frame depends on the random numbers and the size of the picture alone, not on what it shows.
    """

    labels: LabelErrors | None
    disparity: DisparityErrors | None

    @classmethod
    def begin(cls, stereo: Stereo, strengths: Strengths, disparities: Generator, labels: Generator) -> Self:
        """Return the errors of a recording before its first frame."""
        return cls(
            None if stereo == "exact" else LabelErrors(strengths.label, labels),
            DisparityErrors(strengths.disparity, disparities) if stereo == "modelled" else None,
        )

    def branched(self, disparities: Generator, labels: Generator) -> Self:
        """Return errors that were the same up to now and go on by other random numbers."""
        return type(self)(
            self.labels and self.labels.branched(labels), self.disparity and self.disparity.branched(disparities)
        )

    def add(self, exact: Labels, exact_px: Float32s, frames: int = 1) -> tuple[Labels, Float32s]:
        """Return labels and disparity (H, W) with errors of the frame that comes `frames` after the last one."""
        return (
            self.labels.add(exact, frames) if self.labels else exact,
            self.disparity.add(exact_px, frames) if self.disparity else exact_px,
        )
