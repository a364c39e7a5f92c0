"""The ten classes of a semantic grid, their categories and colours, and the way from Cityscapes labels to them."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

NO_POINT = 255
"""Value of the class map for labels that give no point at all: sky, the ego vehicle, void."""


class Category(IntEnum):
    """The paper's categories in ascending drawing priority (supplement, "semantic grid generation")."""

    STATIC = 0
    SMALL_STATIC = 1
    VEHICLES = 2
    SMALL_DYNAMIC = 3


@dataclass(frozen=True)
class GridClass:
    """One class of the grid: its id is its index in `CLASSES`; colour is sRGB."""

    name: str
    category: Category
    colour: tuple[int, int, int]


CLASSES = (
    GridClass("unknown", Category.STATIC, (0, 0, 0)),
    GridClass("road", Category.STATIC, (128, 64, 128)),
    GridClass("sidewalk", Category.STATIC, (244, 35, 232)),
    GridClass("building", Category.STATIC, (110, 110, 110)),
    GridClass("vegetation", Category.STATIC, (60, 140, 60)),
    GridClass("pole_sign", Category.SMALL_STATIC, (220, 220, 0)),
    GridClass("car", Category.VEHICLES, (0, 0, 200)),
    GridClass("large_vehicle", Category.VEHICLES, (0, 160, 170)),
    GridClass("person", Category.SMALL_DYNAMIC, (220, 20, 60)),
    GridClass("bicycle", Category.SMALL_DYNAMIC, (119, 11, 32)),
)
CLASS_NAMES = tuple(entry.name for entry in CLASSES)
CLASS_COUNT = len(CLASSES)
UNKNOWN = CLASS_NAMES.index("unknown")
KNOWN_IDS = tuple(i for i in range(CLASS_COUNT) if i != UNKNOWN)
CATEGORY_NAMES = tuple(category.name.lower() for category in Category)
MASK_COLOUR = (255, 255, 255)
SAFE_COLOURS = (
    (0, 0, 0),
    (28, 51, 83),
    (133, 104, 157),
    (175, 153, 162),
    (50, 102, 26),
    (255, 213, 0),
    (41, 136, 255),
    (178, 206, 255),
    (253, 116, 17),
    (124, 0, 175),
)
"""sRGB by class id, far apart for readers with any kind of colour blindness; the paper's reds and greens are not."""


@dataclass(frozen=True)
class CityscapesLabel:
    """A label of the Cityscapes label set: its train id (255 where it has none), colour and grid class."""

    name: str
    label_id: int
    train_id: int
    colour: tuple[int, int, int]
    grid_class: str | None


# Ids, train ids and colours are those that Cityscapes publishes; the last column is reading 21.
CITYSCAPES_LABELS = tuple(
    CityscapesLabel(*row)
    for row in (
        ("unlabeled", 0, 255, (0, 0, 0), None),
        ("ego vehicle", 1, 255, (0, 0, 0), None),
        ("rectification border", 2, 255, (0, 0, 0), None),
        ("out of roi", 3, 255, (0, 0, 0), None),
        ("static", 4, 255, (0, 0, 0), None),
        ("dynamic", 5, 255, (111, 74, 0), None),
        ("ground", 6, 255, (81, 0, 81), "road"),
        ("road", 7, 0, (128, 64, 128), "road"),
        ("sidewalk", 8, 1, (244, 35, 232), "sidewalk"),
        ("parking", 9, 255, (250, 170, 160), "road"),
        ("rail track", 10, 255, (230, 150, 140), "road"),
        ("building", 11, 2, (70, 70, 70), "building"),
        ("wall", 12, 3, (102, 102, 156), "building"),
        ("fence", 13, 4, (190, 153, 153), "building"),
        ("guard rail", 14, 255, (180, 165, 180), "building"),
        ("bridge", 15, 255, (150, 100, 100), "building"),
        ("tunnel", 16, 255, (150, 120, 90), "building"),
        ("pole", 17, 5, (153, 153, 153), "pole_sign"),
        ("polegroup", 18, 255, (153, 153, 153), "pole_sign"),
        ("traffic light", 19, 6, (250, 170, 30), "pole_sign"),
        ("traffic sign", 20, 7, (220, 220, 0), "pole_sign"),
        ("vegetation", 21, 8, (107, 142, 35), "vegetation"),
        ("terrain", 22, 9, (152, 251, 152), "vegetation"),
        ("sky", 23, 10, (70, 130, 180), None),
        ("person", 24, 11, (220, 20, 60), "person"),
        ("rider", 25, 12, (255, 0, 0), "person"),
        ("car", 26, 13, (0, 0, 142), "car"),
        ("truck", 27, 14, (0, 0, 70), "large_vehicle"),
        ("bus", 28, 15, (0, 60, 100), "large_vehicle"),
        ("caravan", 29, 255, (0, 0, 90), "large_vehicle"),
        ("trailer", 30, 255, (0, 0, 110), "large_vehicle"),
        ("train", 31, 16, (0, 80, 100), "large_vehicle"),
        ("motorcycle", 32, 17, (0, 0, 230), "bicycle"),
        ("bicycle", 33, 18, (119, 11, 32), "bicycle"),
    )
)
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
    return np.array(SAFE_COLOURS if safe else [entry.colour for entry in CLASSES], np.uint8)


def category_members() -> dict[str, tuple[int, ...]]:
    """Return the class ids of each category, `unknown` counted as static like the paper does."""
    return {
        category.name.lower(): tuple(i for i, entry in enumerate(CLASSES) if entry.category is category)
        for category in Category
    }


def priorities() -> NDArray[np.uint8]:
    """Return the drawing priority (C,) of each class: unknown 0, then 1 + category."""
    values = np.array([1 + entry.category for entry in CLASSES], np.uint8)
    values[UNKNOWN] = 0
    return values
