"""What the messages of a log measure, by topic and name: of motion, calibration and pictures."""

import math
import re
from collections.abc import Generator, Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.log import topics
from semgrid_eval.log.findings import Finding, error
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import camera_topic, lidar_of, lidar_topic
from semgrid_eval.motion import MotionSample
from semgrid_eval.recording.colour import ImageSize, read_size
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import CameraCalibration, CameraFrame

_NS_PER_S = 1e9
_CAMERA_TOPIC = re.compile(r"/camera/[^/]+/(.+)")
_MOTION = ("speed_mps", "yaw_rate_radps", "latitude_deg", "longitude_deg", "heading_deg")
_MOUNTING = ("baseline_m", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")
_OPTICS = ("fx_px / width", "fy_px / fx_px", "u0_px / width", "v0_px / height", "fx_px", "fy_px", "u0_px", "v0_px")
_VOID_ID = 255
"""Of pixels without a label in images of train ids; it is not one, so it does not count."""
_SIZE = ("width_px", "height_px")
_SWEEP = ("points", "range_m", "label_id")
_OF_CHANNELS = {
    topics.CALIBRATION: _OPTICS,
    topics.STEREO: _MOUNTING,
    topics.DISPARITY: ("valid_share", *_SIZE),
    topics.IMAGE: _SIZE,
    topics.LABEL: ("label_id",),
}


def quantities_of(topic: str) -> tuple[str, ...]:
    """Name what the messages of a topic measure.

    `valid_share` is the part of a disparity image's pixels that have a disparity, `acceleration_mps2` the change of
    the speed from one message to the next, `points` how many a sweep has; the others are what messages say, or ratios
    of that. The size of a camera's pictures is that of its disparity, of a single camera that of its images.
    """
    if topic == topics.EGO_MOTION:
        return (*_MOTION, "acceleration_mps2")
    if lidar_of(topic) is not None:
        return _SWEEP
    found = _CAMERA_TOPIC.fullmatch(topic)
    return _OF_CHANNELS.get(found[1], ()) if found else ()


class Extent(NamedTuple):
    """The smallest and the largest of some values."""

    low: float
    high: float


Extents = dict[str, dict[str, Extent]]
"""By topic and name."""


def motion_extents(samples: Iterable[MotionSample]) -> Extents:
    """Return what the motion measures."""
    given = list(samples)
    values = {name: [value for each in given if (value := getattr(each, name)) is not None] for name in _MOTION}
    values["acceleration_mps2"] = [
        (after.speed_mps - before.speed_mps) * _NS_PER_S / (after.stamp_ns - before.stamp_ns)
        for before, after in pairwise(given)
        if after.stamp_ns > before.stamp_ns
    ]
    return {topics.EGO_MOTION: {name: Extent(min(each), max(each)) for name, each in values.items() if each}}


def camera_extents(log: LogReader, camera: str) -> Generator[Finding, None, Extents]:
    """Decode every label and disparity image of a camera and return what they and its calibration measure.

    An image that cannot be decoded, or has another size than those before, is an error, and what follows is left out.
    """
    size: ImageSize | None = None
    found: Extents = {}
    for frame in log.frames(camera, images=True):
        try:
            size = _require_size(frame, size)
            for channel, name, extent in _frame_values(frame):
                _widen(found.setdefault(camera_topic(camera, channel), {}), name, extent)
        except InputError as fault:
            yield error(f"camera {camera}", f"picture at {frame.stamp_ns} ns: {fault}")
            return found
    if size is not None:
        calibration = log.calibration(camera)
        mounting = {name: value for name in _MOUNTING if (value := getattr(calibration, name)) is not None}
        found[camera_topic(camera, topics.CALIBRATION)] = _optics(calibration, size)
        found[camera_topic(camera, topics.STEREO)] = {name: _one(value) for name, value in mounting.items()}
        sized = camera_topic(camera, topics.IMAGE if calibration.baseline_m is None else topics.DISPARITY)
        found.setdefault(sized, {}).update(zip(_SIZE, map(_one, size), strict=True))
    return found


def lidar_extents(log: LogReader, lidar: str) -> Extents:
    """Decode every sweep of a LiDAR and return what they measure.

    Raises:
        LogError: a sweep is damaged or impossible.
    """
    found: dict[str, Extent] = {}
    for sweep in log.sweeps(lidar):
        _widen(found, "points", _one(len(sweep.points_m)))
        range_m = np.sqrt(np.square(sweep.points_m, dtype=np.float64).sum(axis=1))
        for name, values in (("range_m", range_m), ("label_id", sweep.label_id)):
            if values is not None and len(values):
                _widen(found, name, Extent(float(values.min()), float(values.max())))
    return {lidar_topic(lidar): found}


def truth_faults(log: LogReader) -> Iterator[Finding]:
    """Look at every true pose and box; the first of each that is impossible is an error."""
    for pose in log.poses():
        if not all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad))):
            yield error(topics.TRUE_POSE, f"is not finite at {pose.stamp_ns} ns")
            break
    boxes = ((stamp_ns, actor) for stamp_ns, actors in log.actors() for actor in actors)
    for stamp_ns, actor in boxes:
        if fault := actor.fault():
            yield error(topics.TRUE_ACTORS, f"at {stamp_ns} ns: actor {actor.actor_id} {fault}")
            break


def _frame_values(frame: CameraFrame) -> Iterator[tuple[str, str, Extent]]:
    if frame.disparity_png is not None:
        share = float((decode_gray(frame.disparity_png, bit_depth=16) > 0).mean())
        yield topics.DISPARITY, "valid_share", _one(share)
    if frame.label_png is not None:
        ids = decode_gray(frame.label_png, bit_depth=8)
        labelled = np.where(ids == _VOID_ID, 0, ids)
        yield topics.LABEL, "label_id", Extent(int(np.min(labelled)), int(np.max(labelled)))


def _require_size(frame: CameraFrame, size: ImageSize | None) -> ImageSize:
    """Return the size of all pictures of a frame, that of the frames before if there were any."""
    pictures = {"disparity": frame.disparity_png, "label": frame.label_png, "image": frame.image_file}
    found = {channel: read_size(png) for channel, png in pictures.items() if png is not None}
    if not found:
        raise InputError("there is neither disparity nor image nor labels")
    size = size or next(iter(found.values()))
    for channel, each in found.items():
        if each != size:
            raise InputError(f"is {each}, not {size}", field=channel)
    return size


def _optics(calibration: CameraCalibration, size: tuple[int, int]) -> dict[str, Extent]:
    """Return intrinsics for pictures of a size (width, height), as numbers of pixels and as ratios."""
    fx, fy, u0, v0 = calibration.fx_px, calibration.fy_px, calibration.u0_px, calibration.v0_px
    values = (fx / size[0], fy / fx, u0 / size[0], v0 / size[1], fx, fy, u0, v0)
    return {name: _one(value) for name, value in zip(_OPTICS, values, strict=True)}


def _one(value: float) -> Extent:
    return Extent(value, value)


def _widen(extents: dict[str, Extent], name: str, extent: Extent) -> None:
    known = extents.get(name, extent)
    extents[name] = Extent(min(known.low, extent.low), max(known.high, extent.high))
