"""Intersection over union by class, by category and with the classes of a category merged (readings 8, 9 and 11)."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, KNOWN_IDS, category_members
from semgrid_eval.scores.metrics.metric import (
    Column,
    Counts,
    Floats,
    Metric,
    Regions,
    ScoredWindows,
    divided,
    mean_finite,
)

CATEGORY_COLUMNS = ("static", "static_known", "small_static", "vehicles", "small_dynamic", "mean_known")
MERGED_COLUMNS = tuple(f"merged_{name}" for name in CATEGORY_COLUMNS if name != "mean_known")
_CATEGORY_LABELS = ("Static", "Static (known)", "Small static", "Vehicles", "Small dynamic", "Mean (known)")
_MERGED_LABELS = (
    *("Static (merged)", "Static (known, merged)", "Small static (merged)"),
    *("Vehicles (merged)", "Small dynamic (merged)"),
)


class Iou(Metric):
    """IoU from the cells by target and predicted class: of classes, means over a category's classes, and merged.

    Cityscapes merges the classes of a category before counting, but knows no class `unknown`: `merged_static_known`
    leaves it out.
    """

    name = "iou"
    title = "IoU"
    shape = (CLASS_COUNT, CLASS_COUNT)
    ratio_names = (*CLASS_NAMES, *MERGED_COLUMNS)
    shown = ("mean_known",)
    columns = (
        *(Column(name, name.replace("_", " ")) for name in CLASS_NAMES),
        *map(Column, CATEGORY_COLUMNS, _CATEGORY_LABELS),
        *map(Column, MERGED_COLUMNS, _MERGED_LABELS),
    )

    def count(self, scored: ScoredWindows, regions: Regions) -> Counts:
        """Count cells by target and predicted class: -> (N, regions, C, C)."""
        codes = scored.target.astype(np.int64) * CLASS_COUNT + scored.prediction
        return regions.tally(codes, CLASS_COUNT**2).reshape(len(codes), regions.count, *self.shape)

    def ratios(self, sums: Counts) -> Counts:
        """Cells that both grids have in a class or merged category, and that either has: (..., C, C) -> (..., K, 2)."""
        target, predicted = sums.sum(axis=-1), sums.sum(axis=-2)
        members, classes = averaged_members(), [(i,) for i in range(CLASS_COUNT)]
        groups = classes + [members[name.removeprefix("merged_")] for name in MERGED_COLUMNS]
        both = np.stack([sum(sums[..., i, j] for i in ids for j in ids) for ids in groups], axis=-1)
        each = np.stack([(target + predicted)[..., list(ids)].sum(axis=-1) for ids in groups], axis=-1)
        return np.stack([both, each - both], axis=-1)

    def figures(self, ratios: Counts) -> Floats:
        """Divide, and take the means over the classes of each category that are there."""
        quotients = divided(ratios[..., 0], ratios[..., 1])
        classes, merged = quotients[..., :CLASS_COUNT], quotients[..., CLASS_COUNT:]
        means = category_iou(classes)
        return np.concatenate([classes, np.stack([means[name] for name in CATEGORY_COLUMNS], axis=-1), merged], axis=-1)

    def cells(self, sums: Counts) -> Counts:
        """Count the target's cells of the classes behind each figure."""
        return np.asarray(sums.sum(axis=-1) @ self._membership.T)

    @cached_property
    def _membership(self) -> NDArray[np.int64]:
        """Which classes stand behind each figure: (Q, C)."""
        table = averaged_members() | {f"merged_{name}": ids for name, ids in averaged_members().items()}
        table |= {name: (i,) for i, name in enumerate(CLASS_NAMES)}
        return np.array([[i in table[column.name] for i in range(CLASS_COUNT)] for column in self.columns], np.int64)


def confusion(target: NDArray[np.uint8], prediction: NDArray[np.uint8], mask: NDArray[np.bool_]) -> Counts:
    """Count cells by (target class, predicted class), leaving out mask M: (N, H, W) each -> (N, C, C).

    Raises:
        ValueError: shapes differ or a class id is not below C.
    """
    if not target.shape == prediction.shape == mask.shape:
        raise ValueError(f"shapes differ: {target.shape}, {prediction.shape}, {mask.shape}")
    if max(target.max(initial=0), prediction.max(initial=0)) >= CLASS_COUNT:
        raise ValueError(f"class ids must be below {CLASS_COUNT}")
    codes = target.astype(np.int64) * CLASS_COUNT + prediction
    return Regions(np.where(mask, -1, 0), 1).tally(codes, CLASS_COUNT**2).reshape(-1, CLASS_COUNT, CLASS_COUNT)


def class_iou(counts: Counts) -> Floats:
    """Intersection over union of each class: (..., C, C) -> (..., C); NaN where a class is in neither."""
    hits = np.diagonal(counts, axis1=-2, axis2=-1)
    return divided(hits, counts.sum(axis=-1) + counts.sum(axis=-2) - hits)


def category_iou(iou: Floats) -> dict[str, Floats]:
    """Mean of the class IoUs of each category, as the paper: (..., C) -> a (...) for each category.

    Classes that are absent (NaN) are left out of the mean.
    """
    return {name: mean_finite(iou[..., list(classes)]) for name, classes in averaged_members().items()}


def averaged_members() -> dict[str, tuple[int, ...]]:
    """Return the class ids behind each mean: the categories, `static_known` and `mean_known` without `unknown`."""
    members = category_members()
    known = tuple(i for i in members["static"] if i in KNOWN_IDS)
    return members | {"static_known": known, "mean_known": KNOWN_IDS}
