"""Argoverse's categories as Cityscapes' labels, which logs hold."""

from semgrid_eval.labels import LABEL_ID

CATEGORIES: dict[str, str] = {
    "ANIMAL": "dynamic",
    "ARTICULATED_BUS": "bus",
    "BICYCLE": "bicycle",
    "BICYCLIST": "rider",
    "BOLLARD": "pole",
    "BOX_TRUCK": "truck",
    "BUS": "bus",
    "CONSTRUCTION_BARREL": "static",
    "CONSTRUCTION_CONE": "static",
    "DOG": "dynamic",
    "LARGE_VEHICLE": "truck",
    "MESSAGE_BOARD_TRAILER": "trailer",
    "MOBILE_PEDESTRIAN_CROSSING_SIGN": "traffic sign",
    "MOTORCYCLE": "motorcycle",
    "MOTORCYCLIST": "rider",
    "OFFICIAL_SIGNALER": "person",
    "PEDESTRIAN": "person",
    "RAILED_VEHICLE": "train",
    "REGULAR_VEHICLE": "car",
    "SCHOOL_BUS": "bus",
    "SIGN": "traffic sign",
    "STOP_SIGN": "traffic sign",
    "STROLLER": "dynamic",
    "TRAFFIC_LIGHT_TRAILER": "trailer",
    "TRUCK": "truck",
    "TRUCK_CAB": "truck",
    "VEHICULAR_TRAILER": "trailer",
    "WHEELCHAIR": "dynamic",
    "WHEELED_DEVICE": "dynamic",
    "WHEELED_RIDER": "rider",
}
"""Cityscapes label by category; `static` and `dynamic` have no grid class, so that cells of such boxes are unknown."""

LABEL_BY_CATEGORY = {category: LABEL_ID[label] for category, label in CATEGORIES.items()}
NOTHING_SEEN = LABEL_ID["unlabeled"]
"""Label of boxes in which no point of a LiDAR lies."""
