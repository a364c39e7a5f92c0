"""Cells by where the inputs had seen something there."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.scores.metrics.metric import Partition, ScoredWindows, only


def _number(scored: ScoredWindows) -> NDArray[np.int64] | None:
    if scored.inputs is None:
        return None
    seen = (scored.inputs != UNKNOWN).any(axis=1)  # (N, T, H, W)
    return np.where(seen[:, -1], 0, np.where(seen.any(axis=1), 1, 2))


ORIGIN = Partition(
    "origin",
    ("in the newest input", "in an older input only", "in no input"),
    "by where the inputs had seen something",
    _number,
    only("accuracy"),
    by_inputs=True,
)
