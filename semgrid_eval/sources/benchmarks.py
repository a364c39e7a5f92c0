"""Named, frozen data sets of the simulated town: what they are made of, and whether recordings are those published.

Light to import: a report asks for it where nothing is simulated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import Field

import semgrid_eval
from semgrid_eval.config import Config, parse_config
from semgrid_eval.files import digest_value, read_json

BENCHMARKS = ("town-v1", "town-rig-v1")
FINGERPRINT_CHARACTERS = 8
"""Of each recording's fingerprint that are published; enough to tell which recordings differ."""

Stereo = Literal["modelled", "matched", "exact"]
"""Where disparity comes from; `exact` has no errors of labels and motion either."""
RigName = Literal["front", "surround", "front+lidar", "surround+lidar"]
"""Which sensors the vehicle has."""
SizeName = Literal["small", "full"]
SIZES: tuple[SizeName, ...] = get_args(SizeName)


class SplitSize(Config):
    """How many recordings a split has, and from how many towns of its own."""

    recordings: Annotated[int, Field(ge=1)]
    towns: Annotated[int, Field(ge=1)]


class BenchmarkSize(Config):
    """One size of a benchmark.

    `fingerprints` are the first characters of every recording's, in the order of split and name, with blanks between;
    null until published.
    """

    seed: int  # of all its towns; sizes have different seeds, so that none trains in a town that another validates in
    train: SplitSize  # recordings to learn from
    val: SplitSize  # recordings to score on
    fingerprints: str | None
    versions: dict[str, str]  # of what made the published recordings, as `versions` returns them


class Benchmark(Config):
    """A frozen data set; another town, picture or count makes a benchmark of another name."""

    name: str  # of the benchmark
    width: int  # of the images in pixels
    height: int  # of the images in pixels
    stereo: Stereo  # as in `SyntheticConfig`, likewise all that follow but the sizes
    rig: RigName = "front"
    town_size_m: float  # side of the square that a town's streets cover
    duration_s: float  # simulated time of a town
    sizes: dict[SizeName, BenchmarkSize]  # by name

    def dataset(self, size: SizeName) -> str:
        """Return the name that its logs, and the results on them, carry."""
        return f"{self.name}/{size}"


@dataclass(frozen=True)
class Comparison:
    """How recordings compare with the published ones."""

    digest: str  # of the recordings that are here
    published: str | None  # digest of the published ones, None while nothing is published
    differing: tuple[str, ...]  # split and name of those that differ


def definition_file(name: str) -> Path:
    """Return the file in the package that defines a benchmark, one of `BENCHMARKS`."""
    assert name in BENCHMARKS
    return Path(semgrid_eval.__file__).parent / "data" / f"{name}.json"


def load_benchmark(name: str) -> Benchmark:
    """Read the definition of a benchmark, one of `BENCHMARKS`."""
    path = definition_file(name)
    return parse_config(Benchmark, read_json(path), path=path)


def compare(size: BenchmarkSize, found: Mapping[str, str]) -> Comparison:
    """Compare the fingerprints of a benchmark's recordings, by split and name, with the published ones."""
    if size.fingerprints is None:
        return Comparison(benchmark_digest(found), None, ())
    published = dict(zip(sorted(found), size.fingerprints.split(), strict=True))
    here = short_fingerprints(found)
    differing = tuple(label for label in sorted(found) if here[label] != published[label])
    return Comparison(benchmark_digest(here), benchmark_digest(published), differing)


@cache
def published_fingerprints(dataset: str) -> frozenset[str]:
    """Return what is published of a benchmark by the name that its logs carry; empty where it is not a benchmark's."""
    for benchmark in map(load_benchmark, BENCHMARKS):
        for name, size in benchmark.sizes.items():
            if benchmark.dataset(name) == dataset:
                return frozenset((size.fingerprints or "").split())
    return frozenset()


def short_fingerprints(found: Mapping[str, str]) -> dict[str, str]:
    """Cut fingerprints to what is published of them."""
    return {label: fingerprint[:FINGERPRINT_CHARACTERS] for label, fingerprint in sorted(found.items())}


def benchmark_digest(fingerprints: Mapping[str, str]) -> str:
    """Digest the fingerprints of all recordings by split and name: the digest of a benchmark (16 characters)."""
    return digest_value(short_fingerprints(fingerprints))
