"""KITTI's sequences as the command line offers them; light to import."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from semgrid_eval.config import Config
from semgrid_eval.sources.known import Source, later

_HELP = """Convert sequences of KITTI or SemanticKITTI to logs OUT/<split>/<sequence>_<first frame>.mcap.

SRC/sequences/<NN> holds velodyne, labels (SemanticKITTI's), image_2 and image_3, calib.txt, times.txt and poses.txt;
poses may also be SRC/poses/<NN>.txt. Scans, or both images, are needed. Disparity is matched from the images; image_2
alone becomes a camera without. Speed and yaw rate come from the poses, and labels become Cityscapes' by a map
(docs/lidar.md).

A recording fails as a whole, in one line, if a file of one of its frames is missing or broken, labels and points
differ in number, a class is unknown or there are too few poses. The others are converted; the exit code is then 1.
Logs whose inputs have not changed are left as they are.
"""
_LONGEST = "Longest recording in seconds; each sequence is cut into equal parts.  0: it stays whole."
_PLACE = "Camera 0 (left, grey): metres ahead of the rear axle, left of the middle and above the ground."


class KittiOptions(Config):
    """Which sequences, and where the cameras are in the vehicle."""

    src: Path
    sequence: Annotated[tuple[str, ...], Field(description="Only this one; may be given several times.")] = ()
    split: Annotated[Literal["train", "val", "test"], Field(description="Of all these sequences.")] = "val"
    recording_s: Annotated[float, Field(ge=0, le=86_400, description=_LONGEST)] = 30.0
    camera_at_m: Annotated[tuple[float, float, float], Field(description=_PLACE)] = (1.68, 0.0, 1.65)


SOURCE = Source(
    options=KittiOptions,
    convert=later("semgrid_eval.sources.kitti.convert:convert_kitti"),
    help=_HELP,
    example="semgrid-eval convert kitti dataset logs --sequence 08",
)
