"""The metrics that every result is scored by, and the counting of them all."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import DEFAULT_CLASSES, ClassSet
from semgrid_eval.scores.metrics.accuracy import Accuracy
from semgrid_eval.scores.metrics.calibration import Calibration
from semgrid_eval.scores.metrics.iou import Iou
from semgrid_eval.scores.metrics.metric import Metric, Regions, ScoredWindows
from semgrid_eval.scores.regions.table import PARTITIONS

IOU, CALIBRATION = Iou(DEFAULT_CLASSES), Calibration()
METRICS: dict[str, Metric] = {metric.name: metric for metric in (IOU, Accuracy(), CALIBRATION)}
"""To add a metric, add a line here. IoU is of the default classes; `metrics_of` has it of others."""

Sums = Mapping[tuple[str, str], NDArray[np.int32]]
"""What was counted, (N, regions, *shape), by the names of metric and partition."""


@lru_cache(maxsize=8)
def iou_of(classes: ClassSet) -> Iou:
    """Return the IoU of some classes."""
    return IOU if classes == DEFAULT_CLASSES else Iou(classes)


def metrics_of(classes: ClassSet) -> dict[str, Metric]:
    """Return the metrics for grids of some classes."""
    return METRICS | {IOU.name: iou_of(classes)}


def count_windows(scored: ScoredWindows) -> dict[tuple[str, str], NDArray[np.int32]]:
    """Count every metric by every partition of the cells that the windows tell."""
    found, metrics = {}, metrics_of(scored.classes).values()
    for partition in PARTITIONS.values():
        number = partition.number(scored)
        if number is None:
            continue
        regions = Regions(np.where(scored.left_out, -1, number), len(partition.regions))
        for metric in metrics:
            found[metric.name, partition.name] = metric.count(scored, regions).astype(np.int32)
    return found
