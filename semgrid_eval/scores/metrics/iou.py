"""Intersection over union by class, by category and with the classes of a category merged (readings 8, 9 and 11)."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import MEAN_KNOWN, ClassSet, known_name
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


class Iou(Metric):
    """IoU from the cells by target and predicted class: of classes, means over a category's classes, and merged.

    Cityscapes merges the classes of a category before counting, but knows no class `unknown`: `merged_static_known`
    leaves it out.
    """

    name = "iou"
    title = "IoU"
    shown = (MEAN_KNOWN,)

    def __init__(self, classes: ClassSet) -> None:
        self.classes = classes
        self.shape = (classes.count, classes.count)
        self._averaged = classes.averaged
        self._merged = {name: ids for name, ids in self._averaged.items() if name != MEAN_KNOWN}
        self.category_columns = tuple(self._averaged)
        self.merged_columns = tuple(f"merged_{name}" for name in self._merged)
        self.ratio_names = (*classes.names, *self.merged_columns)
        words, names = self._words(), (*classes.names, *self.category_columns, *self.merged_columns)
        self.columns = tuple(Column(name, words[name]) for name in names)
        self.labels = {column.name: column.label for column in self.columns}
        self._groups = [(i,) for i in range(classes.count)] + list(self._merged.values())  # behind each ratio

    def _words(self) -> Mapping[str, str]:
        """Return what figures are called in words, by their names."""
        labels = {MEAN_KNOWN: "Mean (known)"}
        for name in self.classes.category_names:
            words = name.replace("_", " ").capitalize()
            labels |= {name: words, f"merged_{name}": f"{words} (merged)"}
            labels |= {known_name(name): f"{words} (known)", f"merged_{known_name(name)}": f"{words} (known, merged)"}
        return labels | {name: name.replace("_", " ") for name in self.classes.names}

    @property
    def compared(self) -> tuple[str, ...]:
        """The figures that rows are compared by: the mean over known classes, and each category without `unknown`."""
        known = (known_name(name) for name in self.classes.category_names)
        pairs = zip(self.classes.category_names, known, strict=True)
        return MEAN_KNOWN, *(known if known in self._averaged else name for name, known in pairs)

    @property
    def moving(self) -> tuple[str, ...]:
        """The figures of what moves: categories that are fast, and of those that are slow each class by itself."""
        found: list[str] = []
        for category in self.classes.categories:
            if category.moves == "fast":
                found.append(category.name)
            elif category.moves:
                found += [self.classes.names[i] for i in self.classes.known_members(category.name)]
        return tuple(found)

    def count(self, scored: ScoredWindows, regions: Regions) -> Counts:
        """Count cells by target and predicted class: -> (N, regions, C, C)."""
        count = self.classes.count
        codes = scored.target.astype(np.int32) * count + scored.prediction
        return regions.tally(codes, count**2).reshape(len(codes), regions.count, *self.shape)

    def ratios(self, sums: Counts) -> Counts:
        """Cells that both grids have in a class or merged category, and that either has: (..., C, C) -> (..., K, 2)."""
        target, predicted = sums.sum(axis=-1), sums.sum(axis=-2)
        both = np.stack([sum(sums[..., i, j] for i in ids for j in ids) for ids in self._groups], axis=-1)
        each = np.stack([(target + predicted)[..., list(ids)].sum(axis=-1) for ids in self._groups], axis=-1)
        return np.stack([both, each - both], axis=-1)

    def figures(self, ratios: Counts) -> Floats:
        """Divide, and take the means over the classes of each category that are there."""
        quotients = divided(ratios[..., 0], ratios[..., 1])
        classes, merged = quotients[..., : self.classes.count], quotients[..., self.classes.count :]
        return np.concatenate([classes, np.stack([*self.means(classes).values()], axis=-1), merged], axis=-1)

    def means(self, iou: Floats) -> dict[str, Floats]:
        """Mean of the class IoUs of each category, as the paper, and of all: (..., C) -> a (...) for each of them.

        Classes that are absent (NaN) are left out of the mean.
        """
        return {name: mean_finite(iou[..., list(classes)]) for name, classes in self._averaged.items()}

    def cells(self, sums: Counts) -> Counts:
        """Count the target's cells of the classes behind each figure."""
        return np.asarray(sums.sum(axis=-1) @ self._membership.T)

    @cached_property
    def _membership(self) -> NDArray[np.int64]:
        """Which classes stand behind each figure: (Q, C)."""
        behind = [*((i,) for i in range(self.classes.count)), *self._averaged.values(), *self._merged.values()]
        return np.array([[i in ids for i in range(self.classes.count)] for ids in behind], np.int64)


def confusion(
    target: NDArray[np.uint8], prediction: NDArray[np.uint8], mask: NDArray[np.bool_], classes: int
) -> Counts:
    """Count cells by (target class, predicted class), leaving out mask M: (N, H, W) each -> (N, C, C).

    Raises:
        ValueError: shapes differ or a class id is not below C.
    """
    if not target.shape == prediction.shape == mask.shape:
        raise ValueError(f"shapes differ: {target.shape}, {prediction.shape}, {mask.shape}")
    if max(target.max(initial=0), prediction.max(initial=0)) >= classes:
        raise ValueError(f"class ids must be below {classes}")
    codes = target.astype(np.int32) * classes + prediction
    return Regions(-mask.view(np.int8), 1).tally(codes, classes**2).reshape(-1, classes, classes)


def class_iou(counts: Counts) -> Floats:
    """Intersection over union of each class: (..., C, C) -> (..., C); NaN where a class is in neither."""
    hits = np.diagonal(counts, axis1=-2, axis2=-1)
    return divided(hits, counts.sum(axis=-1) + counts.sum(axis=-2) - hits)
