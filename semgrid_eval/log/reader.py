"""Read one log: what it says of itself, its channels, and what its messages hold, in the order of time."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import groupby, product
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from semgrid_eval.errors import AbsentSensorError, InputError, LogError
from semgrid_eval.faults import not_one_of
from semgrid_eval.log import calibrations, codec, recovered, topics
from semgrid_eval.log.codec import CONDITIONS_RECORD, PLAYBACK_RECORD, PREDICTIONS_RECORD, RECORD, Scene
from semgrid_eval.log.container import Container, damage_as_log_error
from semgrid_eval.log.frames import FILES, Picture, camera_frames, picture_topics
from semgrid_eval.log.recovered import Recovered
from semgrid_eval.log.sweeps import read_sweep
from semgrid_eval.log.topics import camera_topic, lidar_topic
from semgrid_eval.recording import road_map
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.lidar import LidarSweep
from semgrid_eval.recording.road_map import RoadMap
from semgrid_eval.recording.types import Actor, CameraCalibration, CameraFrame, Moment, MotionSample, Pose, Quantity
from semgrid_eval.words import plural

T = TypeVar("T")
_DECODERS: dict[str, Callable[[bytes], Any]] = {
    topics.EGO_MOTION: codec.read_motion,
    **dict.fromkeys((topics.EGO_POSE, topics.TRUE_POSE), codec.read_pose),
    topics.TRUE_ACTORS: codec.read_actors,
}
_TYPES = {
    topics.EGO_MOTION: "semgrid.v1.Egomotion",
    **dict.fromkeys((topics.EGO_POSE, topics.TRUE_POSE), "foxglove.PoseInFrame"),
    topics.TRUE_ACTORS: "semgrid.v1.Actors",
}
_CAMERA_TYPES = {
    **dict.fromkeys(topics.PICTURE_FIELDS, "foxglove.CompressedImage"),
    topics.CALIBRATION: "foxglove.CameraCalibration",
    topics.STEREO: "semgrid.v1.StereoCalibration",
}
_LIDAR_TYPE = "foxglove.PointCloud"
_OTHERS = {
    PLAYBACK_RECORD: "is a run to be watched, as `semgrid-eval play` writes it, not a recording",
    PREDICTIONS_RECORD: "holds predictions, not a recording",
}
"""What logs of this package are that are not recordings, by their metadata record."""


class Decoded(NamedTuple):
    """What a message says, and its topic and time."""

    topic: str
    stamp_ns: int
    value: Any


class LogReader(Container):
    """One log, read lazily; a `Container` that knows what its messages say.

    Raises:
        LogError: as a container does, and where the file is not a log of this package.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        try:
            entries = self.metadata(RECORD)
            if entries is None:
                foreign = f"has no metadata record {RECORD}; it was not written by semgrid-eval"
                told = (words for name, words in _OTHERS.items() if self.metadata(name) is not None)
                raise LogError(next(told, foreign), path=path)
            with damage_as_log_error(path):
                self.scene = Scene.from_metadata(entries)
        except BaseException:
            self.close()
            raise

    @property
    def lidars(self) -> tuple[str, ...]:
        """Names of the LiDARs whose sweeps the log holds, sorted."""
        found = (topics.lidar_of(channel.topic) for channel in self.summary.channels.values())
        return tuple(sorted({name for name in found if name is not None}))

    @property
    def start_ns(self) -> int:
        """When the log begins: the time of its first message, 0 where it has none."""
        return min((index.message_start_time for index in self.summary.chunk_indexes), default=0)

    def conditions(self) -> dict[str, Quantity]:
        """Return what sets the recording apart from others of its data set, by name; nothing where it does not say."""
        entries = self.metadata(CONDITIONS_RECORD) or {}
        with damage_as_log_error(self.path):
            return codec.read_conditions(entries)

    def recovered(self) -> Recovered | None:
        """Return what the log says of its recovery from a damaged one, None where it is no such log."""
        entries = self.metadata(recovered.RECORD)
        return None if entries is None else Recovered.from_metadata(entries)

    def choose_camera(self, wanted: str | None) -> str:
        """Return the camera that is wanted, or the log's only one where none is.

        Raises:
            AbsentSensorError: there is no such camera, or there are several and none is wanted.
        """
        return self._choose(wanted, self.scene.cameras, "camera")

    def choose_lidar(self, wanted: str | None) -> str:
        """Return the LiDAR that is wanted, or the log's only one where none is.

        Raises:
            AbsentSensorError: there is no such LiDAR, or there are several and none is wanted.
        """
        return self._choose(wanted, self.lidars, "lidar")

    def schemas(self) -> dict[str, str]:
        """Return the name of the message type by topic."""
        names = {number: schema.name for number, schema in self.summary.schemas.items()}
        return {each.topic: names.get(each.schema_id, "") for each in self.summary.channels.values()}

    def wrong_types(self) -> dict[str, str]:
        """Return what is wrong with the messages of topics that hold others than are read from them, by topic."""
        camera_types = {
            camera_topic(camera, channel): kind
            for camera, (channel, kind) in product(self.scene.cameras, _CAMERA_TYPES.items())
        }
        needed = {**_TYPES, **camera_types, **dict.fromkeys(map(lidar_topic, self.lidars), _LIDAR_TYPE)}
        return {
            topic: f"holds {found or 'untyped'} messages; {needed[topic]} is needed"
            for topic, found in self.schemas().items()
            if found != needed.get(topic, found)
        }

    def require_count(self, count: int) -> None:
        """Make sure that as many messages were found as the index states.

        Raises:
            LogError: there are more or fewer.
        """
        if count != self.message_count:
            raise LogError(
                f"holds {plural(count, 'message')}, but its index states {self.message_count}", path=self.path
            )

    def calibration(self, camera: str) -> CameraCalibration:
        """Return the calibration of a camera; one without baseline has no disparity either."""
        self.choose_camera(camera)
        known = self._first(camera_topic(camera, topics.CALIBRATION))
        rest = self._first(camera_topic(camera, topics.STEREO))
        with self._faults_at(camera_topic(camera, topics.CALIBRATION)):
            found = calibrations.read_calibration(known, rest)
        disparity = camera_topic(camera, topics.DISPARITY)
        if found.baseline_m is None and disparity in self.schemas():
            place = f"{camera_topic(camera, topics.STEREO)}: baseline_m"
            raise LogError(f"is 0, and there is {disparity}", path=self.path, field=place)
        return found

    def image_size(self, camera: str) -> ImageSize:
        """Return the size of pictures for which a camera is calibrated."""
        topic = camera_topic(self.choose_camera(camera), topics.CALIBRATION)
        known = self._first(topic)
        with self._faults_at(topic):
            return calibrations.read_size(known)

    def is_single(self, camera: str) -> bool:
        """Tell whether a camera has no disparity."""
        return self.calibration(camera).baseline_m is None

    def motion(self) -> list[MotionSample]:
        """Return all that the vehicle reported of its motion, finite numbers, in the order of time."""
        samples = list(self._values(topics.EGO_MOTION, codec.read_motion))
        for sample in samples:
            if not (math.isfinite(sample.speed_mps) and math.isfinite(sample.yaw_rate_radps)):
                raise LogError(f"is not finite at {sample.stamp_ns} ns", path=self.path, field=topics.EGO_MOTION)
        return samples

    def poses(self) -> list[Pose]:
        """Return the true poses in the order of time; none where the truth is not known."""
        return list(self._values(topics.TRUE_POSE, codec.read_pose))

    def sweeps(self, lidar: str) -> Iterator[LidarSweep]:
        """Iterate over the sweeps of a LiDAR in the order of time."""
        return self._values(lidar_topic(self.choose_lidar(lidar)), read_sweep)

    def actors(self) -> Iterator[tuple[int, tuple[Actor, ...]]]:
        """Iterate over time stamps (ns) and the true boxes of all actors; nothing where the truth is not known."""
        return self._values(topics.TRUE_ACTORS, codec.read_actors)

    def road_map(self) -> RoadMap | None:
        """Return the map around the drive; None where the log has none."""
        data = self.attachments().get(road_map.FILE)
        if data is None:
            return None
        with damage_as_log_error(self.path):
            return RoadMap.from_json(data)

    def moments(self) -> Iterator[Moment]:
        """Iterate over all that the log holds, in the order of time.

        A moment is all that has one stamp; motion belongs to the moment that comes next. Frames are as `frames` says.
        """
        single = {camera for camera in self.scene.cameras if self.is_single(camera)}
        shown = picture_topics(self.scene.cameras, topics.PICTURE_FIELDS)
        swept = {lidar_topic(lidar): lidar for lidar in self.lidars}
        decoders = {**_DECODERS, **dict.fromkeys(shown, codec.read_image), **dict.fromkeys(swept, read_sweep)}
        waiting: list[MotionSample] = []
        messages = _apart_from_motion(self._decoded(decoders), waiting)
        for stamp_ns, of_one_time in groupby(messages, key=lambda message: message.stamp_ns):
            motion = tuple(waiting)
            waiting.clear()
            found = {topic: value for topic, _, value in of_one_time}
            pictures = [Picture(stamp_ns, *shown[topic], value) for topic, value in found.items() if topic in shown]
            _, actors = found.get(topics.TRUE_ACTORS, (stamp_ns, None))
            sweeps = {swept[topic]: value for topic, value in found.items() if topic in swept}
            cameras = dict(camera_frames(pictures, single))
            yield Moment(stamp_ns, cameras, motion, found.get(topics.TRUE_POSE), actors, sweeps)

    def pictures(self, cameras: Iterable[str], channels: Iterable[str]) -> Iterator[Picture]:
        """Iterate over the pictures of some channels of some cameras in the order of time."""
        wanted = picture_topics(cameras, channels)
        for topic, stamp_ns, png in self._decoded({topic: FILES[channel] for topic, (_, channel) in wanted.items()}):
            yield Picture(stamp_ns, *wanted[topic], png)

    def frames(self, camera: str, *, images: bool = False) -> Iterator[CameraFrame]:
        """Iterate over the frames of a camera in the order of time, one chunk of the file in memory at once.

        Messages of equal stamps make a frame. A frame without label, or truth, has None there; one that lacks the
        disparity that others of its camera have, which could not be placed in the world, is left out. Colour images are
        read only where `images` says so.
        """
        single = {camera} if self.is_single(camera) else set[str]()
        channels = [channel for channel in topics.PICTURE_FIELDS if images or channel != topics.IMAGE]
        if single and not images:
            channels.append(topics.CALIBRATION)  # which tells that there is a frame where no picture is read
        return (frame for _, frame in camera_frames(self.pictures([camera], channels), single))

    def _decoded(self, decoders: Mapping[str, Callable[[bytes], Any]]) -> Iterator[Decoded]:
        """Iterate over what messages say; `decoders` maps topics to what reads their messages."""
        self._require_types(decoders)
        for topic, stamp_ns, data, _ in self.messages(decoders):
            with self._faults_at(f"{topic} at {stamp_ns} ns"):
                value = decoders[topic](data)
            yield Decoded(topic, stamp_ns, value)

    @contextmanager
    def _faults_at(self, place: str) -> Iterator[None]:
        """Let whatever a message in the block is wrong with be a LogError that names its place."""
        try:
            with damage_as_log_error(self.path, place):
                yield
        except LogError:
            raise
        except InputError as error:
            raise LogError(str(error), path=self.path, field=place) from error

    def _values(self, topic: str, decode: Callable[[bytes], T]) -> Iterator[T]:
        return (decoded.value for decoded in self._decoded({topic: decode}))

    def _choose(self, wanted: str | None, there: tuple[str, ...], what: str) -> str:
        chosen = there[0] if wanted is None and len(there) == 1 else wanted
        if chosen in there:
            return chosen
        fault = f"there are several, name one: {', '.join(there)}" if chosen is None else not_one_of(chosen, there)
        raise AbsentSensorError(fault if there else "the log has none", path=self.path, field=what)

    def _require_types(self, wanted: Iterable[str]) -> None:
        wrong = self.wrong_types()
        for topic in wanted:
            if topic in wrong:
                raise LogError(wrong[topic], path=self.path, field=topic)

    def _first(self, topic: str) -> bytes:
        self._require_types([topic])
        entry = next(self.messages([topic]), None)
        if entry is None:
            raise LogError("has no message", path=self.path, field=topic)
        return entry.data


def _apart_from_motion(messages: Iterable[Decoded], motion: list[MotionSample]) -> Iterator[Decoded]:
    """Pass messages on, but move what they say of the motion to a list."""
    for message in messages:
        if message.topic == topics.EGO_MOTION:
            motion.append(message.value)
        else:
            yield message
