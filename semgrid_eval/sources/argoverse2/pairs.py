"""Which images of the stereo cameras belong together."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.sources.argoverse2.cameras import cameras_folder, images_of

LEFT, RIGHT = "stereo_front_left", "stereo_front_right"
TOGETHER_NS = 5_000_000
"""Both images of a pair are taken within this time: a tenth of the time between pairs."""


@dataclass(frozen=True)
class Pair:
    """Both images of one time, that of the left one."""

    stamp_ns: int
    left: Path
    right: Path


@dataclass(frozen=True)
class Pairs:
    """What a log holds of both cameras."""

    pairs: tuple[Pair, ...] = ()  # in the order of time
    alone_ns: tuple[int, ...] = ()  # times of images without a partner
    lefts_ns: tuple[int, ...] = ()  # times of all left images


def pairs_of(log: Path) -> Pairs:
    """Find the pairs of a log.

    Raises:
        InputError: there are images, but no pair.
    """
    left, right = (images_of(log, name) for name in (LEFT, RIGHT))
    if not (left or right):
        return Pairs()
    for name, found, other, there in ((LEFT, left, RIGHT, right), (RIGHT, right, LEFT, left)):
        if not found:
            raise InputError(f"holds no image, but {other} holds {len(there)}", path=cameras_folder(log) / name)
    rights_ns = np.array(list(right), np.int64)
    nearest = {stamp_ns: _nearest(stamp_ns, rights_ns) for stamp_ns in left}
    pairs = tuple(
        Pair(stamp_ns, left[stamp_ns], right[other_ns])
        for stamp_ns, other_ns in sorted(nearest.items())
        if abs(other_ns - stamp_ns) <= TOGETHER_NS
    )
    if not pairs:
        fault = f"holds no image within {TOGETHER_NS * 1e-6:g} ms of one of {LEFT}"
        raise InputError(fault, path=cameras_folder(log) / RIGHT)
    rights_alone = set(right) - {int(pair.right.stem) for pair in pairs}
    alone_ns = [*rights_alone, *(set(left) - {pair.stamp_ns for pair in pairs})]
    return Pairs(pairs, tuple(sorted(alone_ns)), tuple(left))


def _nearest(stamp_ns: int, others_ns: NDArray[np.int64]) -> int:
    return int(others_ns[np.abs(others_ns - stamp_ns).argmin()])
