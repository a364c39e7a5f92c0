"""The ten classes of a semantic grid, their categories and colours, and the way from Cityscapes labels to them."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from importlib import resources
from itertools import islice

import numpy as np
from numpy.typing import NDArray

NO_POINT = 255  # value of the class map for labels that give no point at all: sky, the ego vehicle, void


class Category(IntEnum):
    """The paper's categories in ascending drawing priority (supplement, "semantic grid generation")."""

    STATIC = 0
    SMALL_STATIC = 1
    VEHICLES = 2
    SMALL_DYNAMIC = 3


@dataclass(frozen=True)
class GridClass:
    """One class of the grid: its id is its index in `CLASSES`."""

    name: str
    category: Category
    colour: tuple[int, int, int]  # the paper's, sRGB
    # Far from the others for readers with any kind of colour blindness; the paper's reds and greens are not.
    safe_colour: tuple[int, int, int]


CLASSES = (
    GridClass("unknown", Category.STATIC, (0, 0, 0), (0, 0, 0)),
    GridClass("road", Category.STATIC, (128, 64, 128), (28, 51, 83)),
    GridClass("sidewalk", Category.STATIC, (244, 35, 232), (133, 104, 157)),
    GridClass("building", Category.STATIC, (110, 110, 110), (175, 153, 162)),
    GridClass("vegetation", Category.STATIC, (60, 140, 60), (50, 102, 26)),
    GridClass("pole_sign", Category.SMALL_STATIC, (220, 220, 0), (255, 213, 0)),
    GridClass("car", Category.VEHICLES, (0, 0, 200), (41, 136, 255)),
    GridClass("large_vehicle", Category.VEHICLES, (0, 160, 170), (178, 206, 255)),
    GridClass("person", Category.SMALL_DYNAMIC, (220, 20, 60), (253, 116, 17)),
    GridClass("bicycle", Category.SMALL_DYNAMIC, (119, 11, 32), (124, 0, 175)),
)
CLASS_NAMES = tuple(entry.name for entry in CLASSES)
CLASS_COUNT = len(CLASSES)
UNKNOWN = CLASS_NAMES.index("unknown")
KNOWN_IDS = tuple(i for i in range(CLASS_COUNT) if i != UNKNOWN)
CATEGORY_NAMES = tuple(category.name.lower() for category in Category)
MASK_COLOUR = (255, 255, 255)


@dataclass(frozen=True)
class CityscapesLabel:
    """A label of the Cityscapes label set: its train id (255 where it has none), colour and grid class."""

    name: str
    label_id: int
    train_id: int
    colour: tuple[int, int, int]
    grid_class: str | None


def _read_labels() -> Iterator[CityscapesLabel]:
    """Read ids, train ids and colours, which are those that Cityscapes publishes; the grid class is reading 21."""
    text = resources.files("semgrid_eval").joinpath("data/cityscapes_labels.csv").read_text(encoding="utf-8")
    for name, label_id, train_id, red, green, blue, grid_class in islice(csv.reader(text.splitlines()), 1, None):
        colour = int(red), int(green), int(blue)
        yield CityscapesLabel(name, int(label_id), int(train_id), colour, grid_class or None)


CITYSCAPES_LABELS = tuple(_read_labels())
LABEL_ID = {label.name: label.label_id for label in CITYSCAPES_LABELS}


def class_map() -> NDArray[np.uint8]:
    """Return the table (256,) from Cityscapes label id to grid class id, `NO_POINT` where a label gives no point."""
    table = np.full(256, NO_POINT, np.uint8)
    for label in CITYSCAPES_LABELS:
        if label.grid_class is not None:
            table[label.label_id] = CLASS_NAMES.index(label.grid_class)
    return table


def label_ids_from_train_ids() -> NDArray[np.uint8]:
    """Return the table (256,) from Cityscapes train id to label id; what is not a train id becomes 0 (unlabeled)."""
    table = np.zeros(256, np.uint8)
    for label in CITYSCAPES_LABELS:
        if label.train_id != 255:
            table[label.train_id] = label.label_id
    return table


def label_palette() -> NDArray[np.uint8]:
    """Return the sRGB palette (256, 3) of label images: Cityscapes' colours, black beyond its ids."""
    palette = np.zeros((256, 3), np.uint8)
    for label in CITYSCAPES_LABELS:
        palette[label.label_id] = label.colour
    return palette


def class_palette(*, safe: bool = False) -> NDArray[np.uint8]:
    """Return the sRGB palette (C, 3) of grid classes: the paper's colours, or those that are colour-blind-safe."""
    return np.array([entry.safe_colour if safe else entry.colour for entry in CLASSES], np.uint8)


def category_members() -> dict[str, tuple[int, ...]]:
    """Return the class ids of each category, `unknown` counted as static like the paper does."""
    numbered = list(enumerate(CLASSES))
    return {each.name.lower(): tuple(i for i, entry in numbered if entry.category is each) for each in Category}


def priorities() -> NDArray[np.uint8]:
    """Return the drawing priority (C,) of each class: unknown 0, then 1 + category."""
    values = np.array([1 + entry.category for entry in CLASSES], np.uint8)
    values[UNKNOWN] = 0
    return values
