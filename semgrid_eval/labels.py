"""Cityscapes' labels, which logs have for every sensor: names, ids, train ids and colours."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from itertools import islice

import numpy as np
from numpy.typing import NDArray

NO_TRAIN_ID = 255
"""The train id of labels that nothing is trained on."""


@dataclass(frozen=True)
class CityscapesLabel:
    """A label of the Cityscapes label set: its id, train id (`NO_TRAIN_ID` where it has none) and colour."""

    name: str
    label_id: int
    train_id: int
    colour: tuple[int, int, int]


def _read_labels() -> Iterator[CityscapesLabel]:
    """Read ids, train ids and colours, which are those that Cityscapes publishes."""
    text = resources.files("semgrid_eval").joinpath("data/cityscapes_labels.csv").read_text(encoding="utf-8")
    for name, label_id, train_id, red, green, blue in islice(csv.reader(text.splitlines()), 1, None):
        yield CityscapesLabel(name, int(label_id), int(train_id), (int(red), int(green), int(blue)))


CITYSCAPES_LABELS = tuple(_read_labels())
LABEL_ID = {label.name: label.label_id for label in CITYSCAPES_LABELS}
LAST_LABEL_ID = max(LABEL_ID.values())
LAST_TRAIN_ID = max(label.train_id for label in CITYSCAPES_LABELS if label.train_id != NO_TRAIN_ID)


def label_ids_from_train_ids() -> NDArray[np.uint8]:
    """Return the table (256,) from Cityscapes train id to label id; what is not a train id becomes 0 (unlabeled)."""
    table = np.zeros(256, np.uint8)
    for label in CITYSCAPES_LABELS:
        if label.train_id != NO_TRAIN_ID:
            table[label.train_id] = label.label_id
    return table


def label_palette() -> NDArray[np.uint8]:
    """Return the sRGB palette (256, 3) of label images: Cityscapes' colours, black beyond its ids."""
    palette = np.zeros((256, 3), np.uint8)
    for label in CITYSCAPES_LABELS:
        palette[label.label_id] = label.colour
    return palette
