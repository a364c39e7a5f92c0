"""Cityscapes label ids of the ids in label images and clouds, as the map file says."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.labels import CITYSCAPES_LABELS, LABEL_ID, LAST_TRAIN_ID, NO_TRAIN_ID
from semgrid_eval.sources.kitti.labels import CLASSES
from semgrid_eval.sources.ros2.mapping import HIGHEST_PIXEL, Ids


class LabelTable:
    """Turns ids from 0 to `highest` into label ids."""

    def __init__(self, ids: str | Ids, highest: int = HIGHEST_PIXEL) -> None:
        self._table, self._known = np.zeros(highest + 1, np.uint8), np.zeros(highest + 1, np.bool_)
        for name, given in _given(ids).items():
            self._table[list(given)], self._known[list(given)] = LABEL_ID[name], True

    def label_ids(self, ids: NDArray[np.integer]) -> NDArray[np.uint8]:
        """Return label ids of ids of any shape.

        Raises:
            InputError: the map does not name one of them.
        """
        lowest, highest = int(ids.min(initial=0)), int(ids.max(initial=0))
        if lowest < 0 or highest >= len(self._known):
            raise _unknown(lowest if lowest < 0 else highest)
        known = self._known[ids]
        if not known.all():
            raise _unknown(int(ids[~known].min()))
        found: NDArray[np.uint8] = self._table[ids]
        return found


def likely_ids(highest: int) -> str:
    """Guess by the highest of some ids which of Cityscapes' kinds they are."""
    return "train_ids" if highest <= LAST_TRAIN_ID else "label_ids"


def _unknown(label: int) -> InputError:
    return InputError(f"{label} is a label, but not in the map", field="ids")


def _given(ids: str | Ids) -> Ids:
    if isinstance(ids, dict):
        return ids
    if ids == "semantickitti":
        names = {name for _, name in CLASSES.values()}
        return {name: tuple(number for number, (_, label) in CLASSES.items() if label == name) for name in names}
    if ids == "label_ids":
        return {label.name: (label.label_id,) for label in CITYSCAPES_LABELS}
    trained = {label.name: (label.train_id,) for label in CITYSCAPES_LABELS if label.train_id != NO_TRAIN_ID}
    return {**trained, "unlabeled": (NO_TRAIN_ID,)}
