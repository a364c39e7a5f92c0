"""Names of the topics and coordinate frames in a log, and what the channels of pictures say of their coding."""

import json
import re

from semgrid_eval.labels import CITYSCAPES_LABELS

IMAGE = "image"
DISPARITY = "disparity"
LABEL = "label"
EXACT_LABEL = "truth/label"
EXACT_DISPARITY = "truth/disparity"
INSTANCE = "truth/instance"
CALIBRATION = "calibration"
STEREO = "stereo"

TRANSFORMS = "/tf"
EGO_POSE = "/ego/pose"
EGO_MOTION = "/ego/motion"
TRUE_POSE = "/truth/pose"
TRUE_ACTORS = "/truth/actors"

GRID_TARGET = "/grid/target"
GRID_MASK = "/grid/mask"
GRID_CERTAINTY = "/grid/certainty"
GRID_PREDICTION = "/grid/prediction"
GRID_INPUT = "/grid/input"
GRID_LEGEND = "/grid/legend"

BASE_FRAME = "base_link"  # ISO 8855 vehicle frame: x forward, y left, z up, on the ground under the rear axle
ODOM_FRAME = "odom"  # where the vehicle was, and pointed to, at the first sample
GRID_FRAME = "grid"  # moves with the vehicle and never turns
MAP_FRAME = "map"  # x east, y north

_DISPARITY_NOTES = {"coding": "d_px = (p - 1) / 256; p = 0 is invalid", "unit": "px"}
_LABEL_NOTES = {"coding": "Cityscapes label ids", "names": json.dumps({e.label_id: e.name for e in CITYSCAPES_LABELS})}
_INSTANCE_NOTES = {"coding": "actor id of each pixel; 0 is no actor"}
PICTURES: dict[str, tuple[str, dict[str, str]]] = {
    "disparity_png": (DISPARITY, _DISPARITY_NOTES),
    "label_png": (LABEL, _LABEL_NOTES),
    "exact_disparity_png": (EXACT_DISPARITY, _DISPARITY_NOTES),
    "exact_label_png": (EXACT_LABEL, _LABEL_NOTES),
    "instance_png": (INSTANCE, _INSTANCE_NOTES),
    "image_file": (IMAGE, {}),
}
"""Channel of a camera and its metadata by field of `CameraFrame`, in the order of writing.

The colour image, which scoring never reads, comes last and has a chunk of its own.
"""
SWEEP_NOTES = {
    "frame": "points are in the LiDAR's own frame; the pose of a message takes them to base_link",
    "label": _LABEL_NOTES["coding"],
    "names": _LABEL_NOTES["names"],
}
"""Metadata of the channel of a LiDAR; its fields are in `log.sweeps`."""
PICTURE_FIELDS = {channel: field for field, (channel, _) in PICTURES.items()}
"""Field of `CameraFrame` by channel of a camera."""


def camera_topic(camera: str, channel: str) -> str:
    """Return the topic of one channel of a camera; viewers pair channels by what stands before the last slash."""
    return f"/camera/{camera}/{channel}"


def lidar_topic(lidar: str) -> str:
    """Return the topic of a LiDAR's sweeps."""
    return f"/lidar/{lidar}/points"


def lidar_picture_topic(lidar: str) -> str:
    """Return the topic of what a LiDAR saw all around, as a picture; a played run has it."""
    return f"/lidar/{lidar}/label"


def lidar_of(topic: str) -> str | None:
    """Return the name of the LiDAR whose sweeps a topic holds; None where it holds none."""
    found = re.fullmatch(r"/lidar/([^/]+)/points", topic)
    return found[1] if found else None


def optical_frame(camera: str) -> str:
    """Return the name of a camera's optical frame: x right, y down, z forward."""
    return f"camera_{camera}_optical"
