"""Cells near moving and near standing actors, where the logs hold the truth; cells near both are moving."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.grids.spec import MOVING, STANDING
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.scores.metrics.metric import Partition, ScoredWindows


def _number(scored: ScoredWindows) -> NDArray[np.int64] | None:
    if scored.actors is None:
        return None
    standing = np.where(scored.actors & STANDING, 1, -1)
    return np.where(scored.actors & MOVING, 0, standing)


ACTORS = Partition(
    "actors",
    ("moving", "standing"),
    "of the cells near moving and near standing actors",
    _number,
    lambda metric: metric.moving if isinstance(metric, Iou) else (),
)
