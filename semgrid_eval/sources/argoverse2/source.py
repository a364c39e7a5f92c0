"""Argoverse 2 as the command line offers it; light to import."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from semgrid_eval.config import Config
from semgrid_eval.sources.known import Source, later

_HELP = """Convert logs of the Argoverse 2 Sensor data set to OUT/<split>/<log>.mcap.

SRC/<split>/<log> holds annotations.feather, city_SE3_egovehicle.feather and the map archive; sweeps of the LiDAR are
taken along where there are some. A log has boxes of actors, drivable areas and crossings, and speed and yaw rate from
the poses, at the times of boxes. Grids are made of them by sensors of kind `tracks` (docs/lidar.md). The stereo pair,
where its images and calibration are there, becomes a camera: rectified, disparity by matching, without labels. Ring
cameras, where there are images, become cameras without disparity, their JPEG files untouched: once `segment` has
labelled them, they can colour the points of sweeps.

A log fails as a whole, in one line, if a file is missing or broken, a box is not finite, a category unknown, a pose
missing, or an image of another size than its calibration. The others are converted; the exit code is then 1. Logs
whose inputs have not changed are left as they are.
"""
_STEREO = "Every how many pairs of stereo images, of which there are 20 a second, one is taken.  0: none."
_RING = "Every how many images of each ring camera, likewise 20 a second, one is taken.  0: none."


class ArgoverseOptions(Config):
    """Which logs."""

    src: Path
    split: Annotated[tuple[str, ...], Field(description="Only this split; may be given several times.")] = ()
    stereo_every: Annotated[int, Field(ge=0, description=_STEREO)] = 2
    ring_every: Annotated[int, Field(ge=0, description=_RING)] = 2


SOURCE = Source(
    options=ArgoverseOptions,
    convert=later("semgrid_eval.sources.argoverse2.convert:convert_argoverse", extra="argoverse"),
    help=_HELP,
    example="semgrid-eval convert argoverse2 sensor logs --split val",
)
