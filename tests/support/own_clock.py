"""Motion on a clock of its own: recordings whose frames lie between the samples."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from semgrid_eval.recording.types import Moment, MotionSample, Recording


def with_own_motion(recording: Recording, *, every_ns: int = 37_000_000, seed: int = 0) -> Recording:
    """Replace the motion of a recording by random turns and speeds, sampled at other times than its frames."""
    times_ns = [moment.stamp_ns for moment in recording.moments()]
    stamps_ns = np.arange(times_ns[0] - every_ns // 3, times_ns[-1] + every_ns, every_ns).tolist()
    random = np.random.default_rng(seed)
    rates = zip(random.uniform(2.0, 12.0, len(stamps_ns)), random.uniform(-0.6, 0.6, len(stamps_ns)), strict=True)
    samples = [MotionSample(stamp_ns, *map(float, pair)) for stamp_ns, pair in zip(stamps_ns, rates, strict=True)]

    def moments() -> Iterator[Moment]:
        left = list(samples)
        for moment in recording.moments():
            until = sum(sample.stamp_ns <= moment.stamp_ns for sample in left)
            yield dataclasses.replace(moment, motion=tuple(left[:until]))
            del left[:until]

    return dataclasses.replace(recording, moments=moments)
