"""Confusion counts per window and the intersection over union that follows from them (readings 8, 9 and 11)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, UNKNOWN, category_members

Counts = NDArray[np.int64]
Scores = NDArray[np.float64]


def confusion(target: NDArray[np.uint8], prediction: NDArray[np.uint8], mask: NDArray[np.bool_]) -> Counts:
    """Count cells by (target class, predicted class), leaving out mask M: (N, H, W) each -> (N, C, C).

    Raises:
        ValueError: shapes differ or a class id is not below C.
    """
    if not target.shape == prediction.shape == mask.shape:
        raise ValueError(f"shapes differ: {target.shape}, {prediction.shape}, {mask.shape}")
    if max(target.max(initial=0), prediction.max(initial=0)) >= CLASS_COUNT:
        raise ValueError(f"class ids must be below {CLASS_COUNT}")
    count = target.shape[0]
    index = (np.arange(count)[:, None, None] * CLASS_COUNT + target) * CLASS_COUNT + prediction
    flat = np.bincount(index[~mask].ravel(), minlength=count * CLASS_COUNT**2)
    return flat.reshape(count, CLASS_COUNT, CLASS_COUNT)


def class_iou(counts: Counts) -> Scores:
    """Intersection over union of each class: (..., C, C) -> (..., C); NaN where a class is in neither."""
    hits = np.diagonal(counts, axis1=-2, axis2=-1)
    union = counts.sum(axis=-1) + counts.sum(axis=-2) - hits
    return np.asarray(np.divide(hits, union, out=np.full(union.shape, np.nan), where=union > 0))


def category_iou(iou: Scores) -> dict[str, Scores]:
    """Mean of the class IoUs of each category, as the paper: (..., C) -> a (...) for each category.

    Classes that are absent (NaN) are left out of the mean. `static_known` is static without `unknown`, and
    `mean_known` the mean of all classes without `unknown`.
    """
    members = dict(category_members())
    members["static_known"] = tuple(i for i in members["static"] if i != UNKNOWN)
    members["mean_known"] = tuple(i for i in range(CLASS_COUNT) if i != UNKNOWN)
    return {name: _mean_present(iou[..., list(classes)]) for name, classes in members.items()}


def merged_category_iou(counts: Counts) -> dict[str, Scores]:
    """Intersection over union after merging the classes of each category, as Cityscapes: (..., C, C) -> (...) each."""
    names = list(category_members())
    member = np.zeros((CLASS_COUNT, len(names)), np.int64)
    for column, classes in enumerate(category_members().values()):
        member[list(classes), column] = 1
    merged = class_iou(member.T @ counts @ member)
    return {name: merged[..., column] for column, name in enumerate(names)}


def _mean_present(values: Scores) -> Scores:
    present = np.isfinite(values)
    total = np.where(present, values, 0.0).sum(axis=-1)
    number = present.sum(axis=-1)
    return np.asarray(np.divide(total, number, out=np.full(total.shape, np.nan), where=number > 0))
