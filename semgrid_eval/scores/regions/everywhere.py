"""All cells, as one region."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.scores.metrics.metric import ScoredWindows
from semgrid_eval.scores.regions.partition import Partition


def _number(scored: ScoredWindows) -> NDArray[np.int64]:
    return np.zeros(scored.target.shape, np.int64)


EVERYWHERE = Partition("all", ("all",), "", _number)
