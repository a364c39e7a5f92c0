"""The moments of a recording as messages in the order of time, and back."""

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby, product
from typing import Any, NamedTuple

from semgrid_eval.classes import label_palette
from semgrid_eval.errors import InputError
from semgrid_eval.log import codec, topics
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.png import read_header, with_palette
from semgrid_eval.recording.types import CameraFrame, Moment, MotionSample, Recording


class MomentWriter:
    """Writes the moments of a recording as messages."""

    def __init__(self, writer: MessageWriter, recording: Recording) -> None:
        self._writer = writer
        self._recording = recording
        self._ego_motion = EgoMotion()  # as far as it is known by each moment
        self._palette = label_palette()
        self._last_ns = -1

    def write(self) -> None:
        """Write everything.

        Raises:
            InputError: the source is at fault, or its moments are not in the order of time.
        """
        count = 0
        for moment in self._recording.moments():
            self._motion(moment)
            self._advance(moment.stamp_ns, "moment")
            self._vehicle(moment)
            for camera in sorted(moment.cameras):
                self._camera(camera, moment.cameras[camera])
            count += 1
        if not count:
            raise InputError("holds no frame", field=self._recording.name)

    def _advance(self, stamp_ns: int, what: str) -> None:
        if stamp_ns < self._last_ns:
            message = f"{what} at {stamp_ns} ns comes after {self._last_ns} ns"
            raise InputError(message, field=f"{self._recording.name}: stamp_ns")
        self._last_ns = stamp_ns

    def _motion(self, moment: Moment) -> None:
        for sample in moment.motion:
            self._advance(sample.stamp_ns, "motion sample")
            self._ego_motion.add(sample)
            self._writer.write(topics.EGO_MOTION, codec.motion_message(sample), log_ns=sample.stamp_ns)

    def _vehicle(self, moment: Moment) -> None:
        now_ns = moment.stamp_ns
        pose = self._ego_motion.pose_at(now_ns)
        transforms = codec.transforms_message(pose, self._recording.calibrations)
        self._writer.write(topics.TRANSFORMS, transforms, log_ns=now_ns)
        self._writer.write(topics.EGO_POSE, codec.pose_message(pose, topics.ODOM_FRAME), log_ns=now_ns)
        if moment.pose is not None:
            message = codec.pose_message(moment.pose, topics.MAP_FRAME)
            self._writer.write(topics.TRUE_POSE, message, log_ns=now_ns)
        if moment.actors is not None:
            self._writer.write(topics.TRUE_ACTORS, codec.actors_message(now_ns, moment.actors), log_ns=now_ns)

    def _camera(self, camera: str, frame: CameraFrame) -> None:
        header = read_header(frame.disparity_png)
        calibration = self._recording.calibrations[camera]
        known, rest = codec.calibration_messages(frame.stamp_ns, camera, calibration, (header.width, header.height))
        self._writer.write(camera_topic(camera, topics.CALIBRATION), known, log_ns=frame.stamp_ns)
        self._writer.write(camera_topic(camera, topics.STEREO), rest, log_ns=frame.stamp_ns)
        for picture, (channel, notes) in topics.PICTURES.items():
            png: bytes | None = getattr(frame, picture)
            if png is None:
                continue
            if channel in (topics.LABEL, topics.EXACT_LABEL):
                png = with_palette(png, self._palette)
            if channel == topics.IMAGE:
                self._writer.end_chunk()
            message = codec.image_message(frame.stamp_ns, camera, png)
            self._writer.write(camera_topic(camera, channel), message, log_ns=frame.stamp_ns, notes=notes)
        self._writer.end_chunk()


class Picture(NamedTuple):
    """A PNG file of a camera; `channel` is one of `topics.PICTURES`."""

    stamp_ns: int
    camera: str
    channel: str
    png: bytes


class Decoded(NamedTuple):
    """What a message says, and its topic and time."""

    topic: str
    stamp_ns: int
    value: Any


def picture_topics(cameras: Iterable[str], channels: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Return camera and channel by topic."""
    return {camera_topic(camera, channel): (camera, channel) for camera, channel in product(cameras, channels)}


def moment_decoders(cameras: Iterable[str]) -> dict[str, Callable[[bytes], Any]]:
    """Return what decodes the messages that `gather_moments` needs, by topic."""
    return {
        topics.EGO_MOTION: codec.read_motion,
        topics.EGO_POSE: codec.read_pose,
        topics.TRUE_POSE: codec.read_pose,
        topics.TRUE_ACTORS: codec.read_actors,
        **dict.fromkeys(picture_topics(cameras, topics.PICTURE_FIELDS), codec.read_image),
    }


def gather_moments(messages: Iterable[Decoded], cameras: Iterable[str]) -> Iterator[Moment]:
    """Gather the messages of `moment_decoders`, in the order of a log, into moments.

    A moment is all that has one stamp; motion belongs to the moment that comes next.
    """
    shown = picture_topics(cameras, topics.PICTURE_FIELDS)
    waiting: list[MotionSample] = []
    for stamp_ns, of_one_time in groupby(_apart_from_motion(messages, waiting), key=lambda message: message.stamp_ns):
        motion = tuple(waiting)
        waiting.clear()
        found = {topic: value for topic, _, value in of_one_time}
        pictures = [Picture(stamp_ns, *shown[topic], value) for topic, value in found.items() if topic in shown]
        _, actors = found.get(topics.TRUE_ACTORS, (stamp_ns, None))
        yield Moment(stamp_ns, dict(camera_frames(pictures)), motion, found.get(topics.TRUE_POSE), actors)


def _apart_from_motion(messages: Iterable[Decoded], motion: list[MotionSample]) -> Iterator[Decoded]:
    """Pass messages on, but move what they say of the motion to a list."""
    for message in messages:
        if message.topic == topics.EGO_MOTION:
            motion.append(message.value)
        else:
            yield message


def camera_frames(pictures: Iterable[Picture]) -> Iterator[tuple[str, CameraFrame]]:
    """Make frames of pictures in the order of time: those of one camera and one stamp, and the camera's name.

    A frame without label, image or truth has None there; one without disparity, which could not be placed in the
    world, is left out.
    """
    for stamp_ns, of_one_time in groupby(pictures, key=lambda picture: picture.stamp_ns):
        by_camera: dict[str, dict[str, bytes]] = {}
        for picture in of_one_time:
            by_camera.setdefault(picture.camera, {})[topics.PICTURE_FIELDS[picture.channel]] = picture.png
        for camera, found in by_camera.items():
            image_png, label_png = found.pop("image_png", None), found.pop("label_png", None)
            if "disparity_png" in found:
                yield camera, CameraFrame(stamp_ns, image_png=image_png, label_png=label_png, **found)
