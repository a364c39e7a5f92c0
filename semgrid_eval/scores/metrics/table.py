"""The metrics that every result is scored by, and the counting of them all."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.scores.metrics.accuracy import Accuracy
from semgrid_eval.scores.metrics.calibration import Calibration
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.scores.metrics.metric import Metric, Regions, ScoredWindows
from semgrid_eval.scores.regions.table import PARTITIONS

IOU, CALIBRATION = Iou(), Calibration()
METRICS: dict[str, Metric] = {metric.name: metric for metric in (IOU, Accuracy(), CALIBRATION)}
"""To add a metric, add a line here."""

Sums = Mapping[tuple[str, str], NDArray[np.int32]]
"""What was counted, (N, regions, *shape), by the names of metric and partition."""


def count_windows(scored: ScoredWindows) -> dict[tuple[str, str], NDArray[np.int32]]:
    """Count every metric by every partition of the cells that the windows tell."""
    found = {}
    for partition in PARTITIONS.values():
        number = partition.number(scored)
        if number is None:
            continue
        regions = Regions(np.where(scored.left_out, -1, number), len(partition.regions))
        for metric in METRICS.values():
            found[metric.name, partition.name] = metric.count(scored, regions).astype(np.int32)
    return found
