"""Bands of distance from the vehicle."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.scores.metrics.metric import Partition, ScoredWindows, only

EDGES_M = (20.0, 40.0, 60.0)


def bands_of(spec: GridSpec) -> NDArray[np.int64]:
    """Number the band of each cell by the distance of its centre: -> (H, W)."""
    return np.asarray(np.digitize(spec.ranges_m(), EDGES_M), np.int64)


def _number(scored: ScoredWindows) -> NDArray[np.int64]:
    return np.broadcast_to(bands_of(scored.spec), scored.target.shape)


DISTANCE = Partition(
    "distance",
    ("0 to 20 m", "20 to 40 m", "40 to 60 m", "beyond 60 m"),
    "by distance from the vehicle",
    _number,
    only("iou"),
)
