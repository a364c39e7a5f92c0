"""The windows of one row in one recording, one after the other: those that a run keeps, or every one that there is."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.playback.scored import Scored
from semgrid_eval.scores.results import WindowRecord

Grid = NDArray[np.uint8]


class Frame(NamedTuple):
    """The grids of one window."""

    window: WindowRecord
    inputs: Grid  # (S, T, H, W) moved to the target's time, oldest first
    target: Grid  # (H, W)
    mask: Grid  # (H, W), 1 where cells are left out of scores
    prediction: Grid  # (H, W)
    certainty: Grid  # (H, W), 255 = 1


@dataclass(frozen=True)
class RowWindows:
    """The windows of a row in the order of their targets' times, and what passes over their grids."""

    scored: Scored
    windows: tuple[WindowRecord, ...]
    frames: Callable[[], Iterator[Frame]]


def kept_windows(scored: Scored, recording: str) -> RowWindows:
    """Return the windows of a recording that were scored."""
    indices = scored.windows_of[recording]

    def frames() -> Iterator[Frame]:
        return (kept_frame(scored, index) for index in indices)

    return RowWindows(scored, tuple(scored.record.windows[index] for index in indices), frames)


def kept_frame(scored: Scored, index: int) -> Frame:
    """Return the grids of a window as they were scored."""
    arrays = scored.arrays
    grids = (arrays[name][index] for name in ("inputs", "target", "mask", "prediction", "certainty"))
    return Frame(scored.record.windows[index], *grids)
