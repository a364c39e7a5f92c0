"""Names of the topics and coordinate frames in a log."""

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

BASE_FRAME = "base_link"  # ISO 8855 vehicle frame: x forward, y left, z up, on the ground under the rear axle
ODOM_FRAME = "odom"  # where the vehicle was, and pointed to, at the first sample
GRID_FRAME = "grid"  # moves with the vehicle and never turns
MAP_FRAME = "map"  # x east, y north


def camera_topic(camera: str, channel: str) -> str:
    """Return the topic of one channel of a camera; viewers pair channels by what stands before the last slash."""
    return f"/camera/{camera}/{channel}"


def optical_frame(camera: str) -> str:
    """Return the name of a camera's optical frame: x right, y down, z forward."""
    return f"camera_{camera}_optical"
