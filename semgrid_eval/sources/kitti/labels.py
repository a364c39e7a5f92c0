"""SemanticKITTI's classes as Cityscapes' labels, which logs hold; a class that moves counts as the same at rest."""

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.labels import LABEL_ID

CLASSES: dict[int, tuple[str, str]] = {
    0: ("unlabeled", "unlabeled"),
    1: ("outlier", "unlabeled"),
    10: ("car", "car"),
    11: ("bicycle", "bicycle"),
    13: ("bus", "bus"),
    15: ("motorcycle", "motorcycle"),
    16: ("on-rails", "train"),
    18: ("truck", "truck"),
    20: ("other-vehicle", "trailer"),
    30: ("person", "person"),
    31: ("bicyclist", "rider"),
    32: ("motorcyclist", "rider"),
    40: ("road", "road"),
    44: ("parking", "parking"),
    48: ("sidewalk", "sidewalk"),
    49: ("other-ground", "ground"),
    50: ("building", "building"),
    51: ("fence", "fence"),
    52: ("other-structure", "wall"),
    60: ("lane-marking", "road"),
    70: ("vegetation", "vegetation"),
    71: ("trunk", "vegetation"),
    72: ("terrain", "terrain"),
    80: ("pole", "pole"),
    81: ("traffic-sign", "traffic sign"),
    99: ("other-object", "static"),
    252: ("moving-car", "car"),
    253: ("moving-bicyclist", "rider"),
    254: ("moving-person", "person"),
    255: ("moving-motorcyclist", "rider"),
    256: ("moving-on-rails", "train"),
    257: ("moving-bus", "bus"),
    258: ("moving-truck", "truck"),
    259: ("moving-other-vehicle", "trailer"),
}
"""SemanticKITTI's name and the Cityscapes label by SemanticKITTI's id; `unlabeled` and `static` give no point."""

_NO_CLASS = 255
_TABLE = np.full(1 << 16, _NO_CLASS, np.uint8)
for _number, (_, _label) in CLASSES.items():
    _TABLE[_number] = LABEL_ID[_label]


def classes_of(labels: NDArray[np.integer]) -> NDArray[np.uint16]:
    """Return the classes of labels of any integer type (N,): their lower 16 bits; the others number instances."""
    return labels.astype(np.uint16)


def label_ids(classes: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return Cityscapes label ids of SemanticKITTI's classes: (N,) -> (N,).

    Raises:
        InputError: a class is not one of SemanticKITTI's.
    """
    found = _TABLE[classes]
    if len(strange := classes[found == _NO_CLASS]):
        raise InputError(f"holds {strange[0]}, which is not a class of SemanticKITTI")
    return found
