"""Confusion counts per window and the intersection over union that follows from them (readings 8, 9 and 11)."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, KNOWN_IDS, category_members

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
    return _divided(hits, counts.sum(axis=-1) + counts.sum(axis=-2) - hits)


def category_iou(iou: Scores) -> dict[str, Scores]:
    """Mean of the class IoUs of each category, as the paper: (..., C) -> a (...) for each category.

    Classes that are absent (NaN) are left out of the mean.
    """
    return {name: mean_finite(iou[..., list(classes)]) for name, classes in averaged_members().items()}


def averaged_members() -> dict[str, tuple[int, ...]]:
    """Return the class ids behind each mean: the categories, `static_known` and `mean_known` without `unknown`."""
    members = category_members()
    known = tuple(i for i in members["static"] if i in KNOWN_IDS)
    return members | {"static_known": known, "mean_known": KNOWN_IDS}


def merged_category_iou(counts: Counts) -> dict[str, Scores]:
    """Intersection over union after merging the classes of each category: (..., C, C) -> (...) for each category.

    Cityscapes merges so, but knows no class `unknown`: `static_known` leaves it out.
    """
    return {name: _merged_iou(counts, classes) for name, classes in merged_members().items()}


def merged_members() -> dict[str, tuple[int, ...]]:
    """Return the class ids behind each merged score: the categories, and `static_known` without `unknown`."""
    return {name: classes for name, classes in averaged_members().items() if name != "mean_known"}


def _merged_iou(counts: Counts, classes: tuple[int, ...]) -> Scores:
    ids = list(classes)
    target, predicted = counts[..., ids, :], counts[..., :, ids]
    hits = target[..., ids].sum(axis=(-2, -1))
    return _divided(hits, target.sum(axis=(-2, -1)) + predicted.sum(axis=(-2, -1)) - hits)


def mean_finite(values: Scores, *, axis: int = -1) -> Scores:
    """Mean of the values along an axis that are there, NaN where none is."""
    present = np.isfinite(values)
    total = np.where(present, values, 0.0).sum(axis=axis)
    return _divided(total, present.sum(axis=axis))


def _divided(part: Scores | Counts, whole: Counts) -> Scores:
    """Divide, NaN where there is nothing to divide by."""
    return np.asarray(np.divide(part, whole, out=np.full(whole.shape, np.nan), where=whole > 0))
