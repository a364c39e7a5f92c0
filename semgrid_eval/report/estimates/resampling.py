"""Resamples: how often each recording counts in each of them, by recordings or by groups of recordings, then seeds."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.scores.metrics.metric import Counts, Floats, divided

Level = Literal["recordings", "groups"]

DRAWS = 1000
_SENTENCES: Mapping[Level, str] = {
    "recordings": "Intervals come from resampling recordings, taken as independent of each other, and seeds where "
    "there are several. To resample towns, cities or drives first (--resample groups) made no interval wider where it "
    "was tried, on the towns of town-v1.",
    "groups": "Intervals come from resampling groups of recordings (towns, cities or drives), then recordings within "
    "each group, since recordings of one group may depend on each other, and seeds where there are several.",
}


@dataclass(frozen=True)
class Draws:
    """Resamples: `weights` (B, R) of recordings, and for each number S of seeds the `picks` (B, S) of them."""

    weights: NDArray[np.int64]
    picks: Mapping[int, NDArray[np.int64]]

    def resampled(self, sums: Counts) -> Counts:
        """Sum over recordings as often as each counts: (R, ...) -> (B, ...)."""
        flat = sums.reshape(len(sums), -1).astype(np.float64)  # BLAS knows floats only; exact below 2**53
        total = np.rint(self._floats @ flat).astype(np.int64)
        return total.reshape(-1, *sums.shape[1:])

    def over_seeds(self, values: Floats) -> Floats:
        """Take the mean over the seeds that each resample picked: (B, S, Q) -> (B, Q)."""
        present = np.isfinite(values) * self.picks[values.shape[1]][:, :, None]
        total, number = (present * np.nan_to_num(values)).sum(axis=1), present.sum(axis=1)
        return divided(total, number)

    @cached_property
    def _floats(self) -> Floats:
        return self.weights.astype(np.float64)


@dataclass(frozen=True)
class Resampling:
    """How rows are resampled: from which seed (a generator goes on where it is), how often, and by what first."""

    seed: int | np.random.Generator = 0
    draws: int = DRAWS
    level: Level = "recordings"

    @property
    def sentence(self) -> str:
        """What intervals come from, and why."""
        return _SENTENCES[self.level]

    def draw(self, groups: Sequence[str], seed_counts: Iterable[int]) -> Draws:
        """Draw resamples of recordings, given the group of each (R,), and of seeds."""
        generator = np.random.default_rng(self.seed)
        if self.level == "groups":
            weights = group_weights(groups, generator, draws=self.draws)
        else:
            weights = recording_weights(len(groups), generator, draws=self.draws)
        counts = sorted(set(seed_counts))
        picks = {count: generator.multinomial(count, np.full(count, 1 / count), size=len(weights)) for count in counts}
        return Draws(weights, picks)


def recording_weights(recordings: int, generator: np.random.Generator, *, draws: int) -> NDArray[np.int64]:
    """Draw how often each recording counts in each resample: (B, R); no draws where one recording is all there is."""
    if recordings < 2:
        return np.zeros((0, recordings), np.int64)
    return generator.multinomial(recordings, np.full(recordings, 1 / recordings), size=draws)


def group_weights(groups: Sequence[str], generator: np.random.Generator, *, draws: int) -> NDArray[np.int64]:
    """Draw groups, and for each time that a group is drawn, as many of its recordings as it has: (R,) -> (B, R)."""
    names, group_of = np.unique(np.asarray(groups, dtype=str), return_inverse=True)
    times = recording_weights(len(names), generator, draws=draws)  # (B, G)
    weights = np.zeros((len(times), len(groups)), np.int64)
    for group in range(len(names)):
        mine = np.flatnonzero(group_of == group)
        # Drawing m times n of n recordings is drawing m * n of them.
        weights[:, mine] = generator.multinomial(times[:, group] * len(mine), np.full(len(mine), 1 / len(mine)))
    return weights
