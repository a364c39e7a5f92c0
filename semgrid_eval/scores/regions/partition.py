"""What a partition of cells is."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.scores.metrics.metric import ScoredWindows

CellNumbers = Callable[[ScoredWindows], NDArray[np.int64] | None]


@dataclass(frozen=True)
class Partition:
    """Cells of windows divided into regions.

    `number` numbers the region of each cell (N, H, W), -1 where it is in none; it returns None where windows do not
    tell. `shown` is what a report shows: columns by metric; of a metric that is not named, nothing.
    """

    name: str  # in files and columns
    regions: Sequence[str]  # their names, as a reader sees them
    words: str  # which cells the regions hold, to follow "IoU"; empty where it is all of them
    number: CellNumbers
    shown: Mapping[str, Sequence[str]] = field(default_factory=dict)
