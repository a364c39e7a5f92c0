"""How long the stages of a chain take, frame by frame: measured once, kept as JSON, and drawn from."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.faults import not_one_of
from semgrid_eval.files import read_json, write_json
from semgrid_eval.words import plural

STAGES = ("decode", "segment", "match", "grid", "align")
"""Stages of a chain before the model, in the order in which they come; a chain need not have all."""
LONGEST_MS = 3_600_000.0
_LIMIT_BYTES = 64 << 20
_NS_PER_MS = 1e6

Samples = Annotated[tuple[Annotated[float, Field(ge=0.0, le=LONGEST_MS)], ...], Field(min_length=1)]
"""Milliseconds, one a measured frame (N,)."""


class MadeBy(Config):
    """What a profile comes from."""

    command: str  # that measured it
    version: str  # of this package
    machine: dict[str, str]  # in words, by what is said: processor, cores, threads, device


class LatencyProfile(Config):
    """Milliseconds that each stage took, N measured frames; place n of all lists is the same frame.

    So frames that were slow in one stage are drawn with what they took in the others.
    """

    format: Literal[1]
    made_by: MadeBy
    stages: Annotated[dict[str, Samples], Field(min_length=1)]  # by name, of `STAGES`
    models: dict[str, Samples] = Field(default_factory=dict)  # by name; each frame was predicted by all of them

    @field_validator("stages")
    @classmethod
    def _stages_are_known(cls, stages: dict[str, Samples]) -> dict[str, Samples]:
        for name in stages:
            if name not in STAGES:
                raise ValueError(not_one_of(name, STAGES))
        return stages

    @model_validator(mode="after")
    def _frames_are_the_same(self) -> Self:
        (first, samples), *others = self._parts()
        for name, other in others:
            if len(other) != len(samples):
                raise ValueError(f"{name} has {plural(len(other), 'sample')}, and {first} has {len(samples)}")
        return self

    @property
    def frames(self) -> int:
        """How many frames were measured, N."""
        return len(next(iter(self.stages.values())))

    def model_ms(self, model: str) -> NDArray[np.float64]:
        """Return what a model took for each frame: (N,).

        Raises:
            InputError: it was not measured.
        """
        if model not in self.models:
            known = ", ".join(self.models) or "none"
            raise InputError(f"was not measured; the profile has: {known}", field=f"model {model}")
        return np.array(self.models[model], np.float64)

    def chain_ms(self, model: str | None) -> NDArray[np.float64]:
        """Return what a frame took from its pictures to the answer of a model, or to aligned grids for None: (N,).

        Raises:
            InputError: the model was not measured.
        """
        before = np.sum([self.stages[name] for name in STAGES if name in self.stages], axis=0, dtype=np.float64)
        return np.asarray(before if model is None else before + self.model_ms(model))

    def draw_ns(self, model: str | None, count: int, *, seed: int, scale: float = 1.0) -> NDArray[np.int64]:
        """Draw whole frames with replacement, and return what each took: (count,), to the nanosecond.

        The same seed gives the same draws on every machine; `scale` multiplies them.

        Raises:
            InputError: the model was not measured, or the scale is not a number from 0.
        """
        if not (math.isfinite(scale) and scale >= 0.0):
            raise InputError(f"{scale:g} is not a number from 0", field="scale")
        rng = np.random.Generator(np.random.PCG64(seed))
        drawn = self.chain_ms(model)[rng.integers(0, self.frames, count)]
        return np.rint(drawn * (scale * _NS_PER_MS)).astype(np.int64)

    def _parts(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        yield from ((f"stages.{name}", samples) for name, samples in self.stages.items())
        yield from ((f"models.{name}", samples) for name, samples in self.models.items())


def read_profile(path: Path) -> LatencyProfile:
    """Read a profile.

    Raises:
        InputError: the file cannot be read or is not a profile; the message names file, field and value.
    """
    return parse_config(LatencyProfile, read_json(path, limit=_LIMIT_BYTES), path=path)


def write_profile(path: Path, profile: LatencyProfile) -> None:
    """Write a profile atomically."""
    write_json(path, profile.model_dump(mode="json"))


class Spread(NamedTuple):
    """How samples are spread, in milliseconds."""

    median_ms: float
    p99_ms: float  # 99th percentile, between samples by interpolation
    max_ms: float


def spread(samples_ms: Sequence[float] | NDArray[np.float64]) -> Spread:
    """Describe samples (N,)."""
    median_ms, p99_ms, max_ms = np.percentile(samples_ms, (50, 99, 100))
    return Spread(float(median_ms), float(p99_ms), float(max_ms))
