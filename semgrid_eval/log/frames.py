"""Frames of cameras, made of the pictures in a log that have one time."""

from collections.abc import Iterable, Iterator, Set
from itertools import groupby, product
from typing import NamedTuple

from semgrid_eval.log import codec, topics
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.recording.types import CameraFrame

FILES = {**dict.fromkeys(topics.PICTURE_FIELDS, codec.read_image), topics.CALIBRATION: lambda _: b""}
"""What reads the file in a message of a channel; of a calibration there is none."""
_MAIN_FIELDS = ("image_file", "disparity_png", "label_png")


class Picture(NamedTuple):
    """A PNG file of a camera, or JPEG if in colour; `channel` is one of `topics.PICTURES`, or a calibration's."""

    stamp_ns: int
    camera: str
    channel: str
    png: bytes


def picture_topics(cameras: Iterable[str], channels: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Return camera and channel by topic."""
    return {camera_topic(camera, channel): (camera, channel) for camera, channel in product(cameras, channels)}


def camera_frames(pictures: Iterable[Picture], single: Set[str]) -> Iterator[tuple[str, CameraFrame]]:
    """Make frames of pictures in the order of time: those of one camera and one stamp, and the camera's name.

    A frame without label, image or truth has None there; one without disparity is left out, but of `single` cameras.
    """
    for stamp_ns, of_one_time in groupby(pictures, key=lambda picture: picture.stamp_ns):
        by_camera: dict[str, dict[str, bytes]] = {}
        for picture in of_one_time:
            found = by_camera.setdefault(picture.camera, {})
            if picture.channel in topics.PICTURE_FIELDS:
                found[topics.PICTURE_FIELDS[picture.channel]] = picture.png
        for camera, found in by_camera.items():
            if camera in single or "disparity_png" in found:
                yield camera, CameraFrame(stamp_ns, **{**dict.fromkeys(_MAIN_FIELDS), **found})
