"""The moments of a recording as messages in the order of time, and back."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from semgrid_eval.classes import label_palette
from semgrid_eval.errors import InputError
from semgrid_eval.log import codec, topics
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.png import read_header, with_palette
from semgrid_eval.recording.types import Actor, CameraFrame, Moment, MotionSample, Pose, Recording


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
            raise InputError(
                f"{what} at {stamp_ns} ns comes after {self._last_ns} ns", field=f"{self._recording.name}: stamp_ns"
            )
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


def moment_topics(cameras: Iterable[str]) -> list[str]:
    """List the topics that `read_moments` reads."""
    return [topics.EGO_MOTION, topics.EGO_POSE, topics.TRUE_POSE, topics.TRUE_ACTORS, *_picture_topics(cameras)]


def read_moments(messages: Iterable[tuple[str, int, bytes]], cameras: Iterable[str]) -> Iterator[Moment]:
    """Gather messages (topic, time in ns, data) of `moment_topics`, in the order of a log, into moments.

    A moment is all that has one stamp; motion belongs to the moment that comes next. A frame without disparity, which
    could not be placed in the world, is left out.

    Raises:
        DecodeError: a message is damaged.
    """
    pictures = _picture_topics(cameras)
    motion: list[MotionSample] = []
    gathered: _Gathered | None = None
    for topic, stamp_ns, data in messages:
        if topic == topics.EGO_MOTION:
            motion.append(codec.read_motion(data))
            continue
        if gathered is None or gathered.stamp_ns != stamp_ns:
            if gathered is not None:
                yield gathered.moment()
            gathered = _Gathered(stamp_ns, tuple(motion))
            motion.clear()
        if topic in pictures:
            camera, picture = pictures[topic]
            gathered.cameras.setdefault(camera, {})[picture] = read_picture(data)
        else:
            gathered.add_truth(topic, data)
    if gathered is not None:
        yield gathered.moment()


@dataclass
class _Gathered:
    """What was read of one moment so far; pictures by camera and field of `CameraFrame`."""

    stamp_ns: int
    motion: tuple[MotionSample, ...]
    pose: Pose | None = None
    actors: tuple[Actor, ...] | None = None
    cameras: dict[str, dict[str, bytes]] = field(default_factory=dict)

    def add_truth(self, topic: str, data: bytes) -> None:
        if topic == topics.TRUE_POSE:
            self.pose = codec.read_pose(data)
        elif topic == topics.TRUE_ACTORS:
            _, self.actors = codec.read_actors(data)

    def moment(self) -> Moment:
        frames = {camera: camera_frame(self.stamp_ns, pictures) for camera, pictures in self.cameras.items()}
        placed = {camera: frame for camera, frame in frames.items() if frame is not None}
        return Moment(self.stamp_ns, placed, self.motion, self.pose, self.actors)


def camera_frame(stamp_ns: int, pictures: dict[str, bytes]) -> CameraFrame | None:
    """Make a frame of pictures by field name; None without disparity."""
    if "disparity_png" not in pictures:
        return None
    known = dict(pictures)
    image_png, label_png = known.pop("image_png", None), known.pop("label_png", None)
    return CameraFrame(stamp_ns, image_png=image_png, label_png=label_png, **known)


def read_picture(data: bytes) -> bytes:
    """Read the PNG file in a message.

    Raises:
        DecodeError: the message is damaged.
    """
    return bytes(CompressedImage.FromString(data).data)


def _picture_topics(cameras: Iterable[str]) -> dict[str, tuple[str, str]]:
    return {
        camera_topic(camera, channel): (camera, picture)
        for camera in cameras
        for picture, (channel, _) in topics.PICTURES.items()
    }
