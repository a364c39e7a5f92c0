"""Which images of a log are taken: every so many by time, at times of known motion, pairs without a hole."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from semgrid_eval.sources.argoverse2.cameras import Images
from semgrid_eval.sources.argoverse2.pairs import Pair, Pairs, pairs_of
from semgrid_eval.sources.argoverse2.ring import ring_images

OUTSIDE, ALONE, BESIDE_HOLE = "outside the boxes' times", "without a partner", "before or after a hole"
"""Why images are left out that are not just passed over."""


class Every(NamedTuple):
    """Every how many images one is taken; 0: none."""

    stereo: int  # of pairs
    ring: int  # of each ring camera


@dataclass(frozen=True)
class Span:
    """The times during which motion is known."""

    first_ns: int
    last_ns: int

    def __contains__(self, stamp_ns: int) -> bool:
        return self.first_ns <= stamp_ns <= self.last_ns


@dataclass(frozen=True)
class Taken:
    """The images of a log that its recording shows."""

    pairs: tuple[Pair, ...]  # in the order of time
    rings: dict[str, Images]  # of ring cameras that have some
    lost: Counter[str]  # how many others were left out, by why

    @property
    def files(self) -> list[Path]:
        """The files of all."""
        files = [path for pair in self.pairs for path in (pair.left, pair.right)]
        return files + [path for images in self.rings.values() for path in images.values()]


def take(log: Path, every: Every, span: Span) -> Taken:
    """Choose images of a log.

    Raises:
        InputError: there are stereo images, but no pair.
    """
    lost: Counter[str] = Counter()
    pairs = _whole_pairs(pairs_of(log), every.stereo, span, lost) if every.stereo else ()
    rings: dict[str, Images] = {}
    for name, images in (ring_images(log) if every.ring else {}).items():
        lost[OUTSIDE] += sum(stamp_ns not in span for stamp_ns in images)
        chosen = {now_ns: images[now_ns] for now_ns in on_raster(images, every.ring).values() if now_ns in span}
        rings |= {name: chosen} if chosen else {}
    return Taken(pairs, rings, lost)


def on_raster(stamps_ns: Iterable[int], every: int) -> dict[int, int]:
    """Return the times at every so many median steps from the first on, by number from 0.

    Where a time is missing, its number is; those after it keep theirs. Steps are counted one by one, so that a step
    that is a little longer than the median does not add up.
    """
    ordered = sorted(stamps_ns)
    steps_ns = np.diff(np.array(ordered, np.int64))
    counts = np.rint(steps_ns / np.median(steps_ns)).astype(np.int64) if len(steps_ns) else steps_ns
    numbers = np.concatenate([[0], counts.cumsum()])[: len(ordered)].tolist()
    found: dict[int, int] = {}
    for number, stamp_ns in zip(numbers, ordered, strict=True):
        if number % every == 0:
            found.setdefault(number // every, stamp_ns)
    return found


def _whole_pairs(found: Pairs, every: int, span: Span, lost: Counter[str]) -> tuple[Pair, ...]:
    """Choose the longest part without a hole: windows count frames."""
    inside = {pair.stamp_ns: pair for pair in found.pairs if pair.stamp_ns in span}
    alone = sum(stamp_ns in span for stamp_ns in found.alone_ns)
    lost[OUTSIDE] += len(found.alone_ns) - alone + 2 * (len(found.pairs) - len(inside))
    lost[ALONE] += alone
    raster_ns = on_raster(found.lefts_ns, every)
    numbers = [number for number, stamp_ns in raster_ns.items() if stamp_ns in inside]
    whole = _longest_run(numbers)
    lost[BESIDE_HOLE] += 2 * (len(numbers) - len(whole))
    return tuple(inside[raster_ns[number]] for number in whole)


def _longest_run(numbers: list[int]) -> list[int]:
    """Return the longest part of growing numbers that leaves none out, the first of several."""
    parts = np.split(np.array(numbers, np.int64), np.flatnonzero(np.diff(numbers) > 1) + 1)
    return max((part.tolist() for part in parts), key=len)
