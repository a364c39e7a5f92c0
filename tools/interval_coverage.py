"""Measures how often intervals of few recordings miss the truth, by simulation: the table of `docs/report.md`.

python tools/interval_coverage.py                                  simulated recordings
python tools/interval_coverage.py --run RUN ROW OTHER COLUMN       those of a run, taken as all that there are
"""
# ruff: noqa: T201 - the tables go to stdout

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.report.estimates.bootstrap import recording_weights
from semgrid_eval.report.estimates.division import EVERYWHERE, row_sums
from semgrid_eval.report.estimates.intervals import intervals_of, stretched
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import IOU

RECORDINGS = (3, 5, 10, 20, 50, 120)
DRAWS = 1000
Values = NDArray[np.float64]
World = Callable[[int, np.random.Generator], tuple[Values, Callable[[Values], Values]]]
"""Draws recordings (R, K): what is summed of each, the cells behind the figure first, and how the figure follows."""


def normal(recordings: int, generator: np.random.Generator) -> tuple[Values, Callable[[Values], Values]]:
    """Recordings whose differences are normal and weigh alike: the figure is their mean."""
    sums = np.stack([np.ones(recordings), generator.normal(size=recordings)], axis=-1)
    return sums, lambda total: total[..., 1] / total[..., 0]


def ratio(recordings: int, generator: np.random.Generator) -> tuple[Values, Callable[[Values], Values]]:
    """Recordings with a class in 6 of 10, and of most different sizes: the figure is a difference of two IoUs.

    What is found of the class depends on its size, and differs between recordings more than between the two rows.
    """
    size = generator.normal(size=recordings)
    cells = np.rint(np.exp(4 + size)) * (generator.random(recordings) < 0.6)
    usual = 0.5 * size + 0.8 * generator.normal(size=recordings)
    found = [cells / (1 + np.exp(-usual - step * (1 + generator.normal(size=recordings)))) for step in (0.0, 0.3)]
    return np.stack([cells, *found], axis=-1), _difference


def _difference(total: Values) -> Values:
    with np.errstate(invalid="ignore"):
        return np.asarray((total[..., 2] - total[..., 1]) / total[..., 0])


def of_run(run: Path, names: tuple[str, str], column: str) -> tuple[World, float]:
    """Recordings of a run, each as likely as the others, and the difference of two rows over all of them."""
    rows = {row.name: row for row in load_runs([run])[0].rows}
    sums = [row_sums(rows[name], IOU, EVERYWHERE)[0].parts[0] for name in names]
    at = list(IOU.labels).index(column)
    ratios = np.stack([part.ratios for part in sums], axis=1)  # (R, 2, K, 2)
    whole = np.concatenate([sums[0].cells[:, at, None], ratios.reshape(len(ratios), -1)], axis=1).astype(np.float64)

    def figure(total: Values) -> Values:
        pairs = np.rint(total[..., 1:]).astype(np.int64).reshape(*total.shape[:-1], *ratios.shape[1:])
        return np.asarray(np.subtract(*np.moveaxis(IOU.figures(pairs)[..., at], -1, 0)))

    def world(recordings: int, generator: np.random.Generator) -> tuple[Values, Callable[[Values], Values]]:
        return whole[generator.integers(0, len(whole), recordings)], figure

    return world, float(figure(whole.sum(axis=0)))


def misses(world: World, truth: float, recordings: int, trials: int) -> Iterator[tuple[float, ...]]:
    """Go through trials: is the truth below or above the interval of resamples, and below or above the longer one."""
    generator = np.random.default_rng([recordings, trials])
    for _ in range(trials):
        sums, figure = world(recordings, generator)
        units = int((sums[:, 0] > 0).sum())
        if units < 2:  # there is no interval
            continue
        draws = figure(recording_weights(recordings, generator, draws=DRAWS) @ sums)[:, None]
        both = np.hstack([draws, stretched(draws, np.array([units]))])
        short, long = intervals_of([float(figure(sums.sum(0)))] * 2, both)
        yield truth < short.low, truth > short.high, truth < long.low, truth > long.high


def table(world: World, truth: float, trials: int) -> Iterator[str]:
    """Write a line for each number of recordings: percent of trials that miss the truth on either side."""
    yield "| recordings | resamples alone: truth below, above | lengthened: truth below, above |"
    yield "|---|---|---|"
    for recordings in RECORDINGS:
        below, above, less, more = 100 * np.mean(list(misses(world, truth, recordings, trials)), axis=0)
        yield f"| {recordings} | {below:.1f} %, {above:.1f} % | {less:.1f} %, {more:.1f} % |"


def main() -> None:
    """Print the table of each simulation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", nargs=4, metavar=("RUN", "ROW", "OTHER", "COLUMN"))
    parser.add_argument("--trials", type=int, default=4000)
    asked = parser.parse_args()
    if asked.run:
        run, *names, column = asked.run
        worlds = {f"{names[0]} less {names[1]}, {column}": of_run(Path(run), (names[0], names[1]), column)}
    else:
        many, figure = ratio(4_000_000, np.random.default_rng(0))
        worlds = {"normal": (normal, 0.0), "a difference of two IoUs": (ratio, float(figure(many.sum(axis=0))))}
    for name, (world, truth) in worlds.items():
        print(f"\n{name}\n", *table(world, truth, asked.trials), sep="\n")


if __name__ == "__main__":
    main()
