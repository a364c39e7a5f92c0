"""Read one log: what it says of itself, its channels, and what its messages hold, in the order of time."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.log import codec, topics
from semgrid_eval.log.container import Container, Entry, damage_as_log_error
from semgrid_eval.log.moments import Decoded, Picture, camera_frames, gather_moments, moment_decoders, picture_topics
from semgrid_eval.log.scene import RECORD, Scene
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.recording.types import Actor, CameraCalibration, CameraFrame, Moment, MotionSample, Pose

T = TypeVar("T")


class LogReader:
    """One log, read lazily; closes its file with its block, or by `close`.

    Raises:
        LogError: the file cannot be read, is damaged, was not written to the end, or is not a log of this package;
            damage that only shows when more is read is raised then, by every method that reads.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._container = Container(path)
        try:
            entries = self._container.metadata(RECORD)
            if entries is None:
                raise LogError(f"has no metadata record {RECORD}; it was not written by semgrid-eval", path=path)
            with damage_as_log_error(path):
                self.scene = Scene.from_metadata(entries)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._container.close()

    @property
    def digest(self) -> str:
        """Digest of the content, from the log's own index and checksums (16 hexadecimal characters)."""
        return self._container.digest()

    @property
    def start_ns(self) -> int:
        """When the log begins: the time of its first message, 0 where it has none."""
        return min((index.message_start_time for index in self._container.summary.chunk_indexes), default=0)

    def choose_camera(self, wanted: str | None) -> str:
        """Return the camera that is wanted, or the log's only one where none is.

        Raises:
            LogError: there is no such camera, or there are several and none is wanted.
        """
        cameras = self.scene.cameras
        chosen = cameras[0] if wanted is None and len(cameras) == 1 else wanted
        if chosen not in cameras:
            known = ", ".join(cameras)
            raise LogError(f"{wanted or '(not given)'} is not one of: {known}", path=self.path, field="camera")
        return chosen

    def verify(self) -> None:
        """Compare the checksum of everything in the file with its bytes.

        Raises:
            LogError: they differ.
        """
        self._container.verify_data()

    @property
    def has_checksums(self) -> bool:
        """Whether the writer gave checksums of data and index, so that any damage is seen."""
        return self._container.has_checksums

    def schemas(self) -> dict[str, str]:
        """Return the name of the message type by topic."""
        summary = self._container.summary
        return {
            channel.topic: summary.schemas[channel.schema_id].name if channel.schema_id in summary.schemas else ""
            for channel in summary.channels.values()
        }

    def stamps_ns(self) -> dict[str, list[int]]:
        """Return the times of all messages by topic, ascending; this reads the whole file.

        Raises:
            LogError: what is read is damaged, or the index states another number of messages.
        """
        found: dict[str, list[int]] = {topic: [] for topic in self.schemas()}
        for entry in self._container.entries():
            found[entry.topic].append(entry.log_ns)
        count = sum(len(stamps) for stamps in found.values())
        if count != self._container.message_count:
            stated = self._container.message_count
            raise LogError(f"holds {count} messages, but its index states {stated}", path=self.path)
        return found

    def calibration(self, camera: str) -> CameraCalibration:
        """Return the calibration of a camera.

        Raises:
            LogError: there is no such camera, or its calibration is damaged or impossible.
        """
        self.choose_camera(camera)
        known = self._first(camera_topic(camera, topics.CALIBRATION))
        rest = self._first(camera_topic(camera, topics.STEREO))
        try:
            with damage_as_log_error(self.path):
                return codec.read_calibration(known, rest)
        except LogError:
            raise
        except InputError as error:
            raise LogError(str(error), path=self.path, field=camera_topic(camera, topics.CALIBRATION)) from error

    def motion(self) -> list[MotionSample]:
        """Return all that the vehicle reported of its motion, in the order of time.

        Raises:
            LogError: a sample is damaged or not a finite number.
        """
        samples = list(self._values(topics.EGO_MOTION, codec.read_motion))
        for sample in samples:
            if not (math.isfinite(sample.speed_mps) and math.isfinite(sample.yaw_rate_radps)):
                raise LogError(f"is not finite at {sample.stamp_ns} ns", path=self.path, field=topics.EGO_MOTION)
        return samples

    def poses(self) -> list[Pose]:
        """Return the true poses in the order of time; none where the truth is not known."""
        return list(self._values(topics.TRUE_POSE, codec.read_pose))

    def actors(self) -> Iterator[tuple[int, tuple[Actor, ...]]]:
        """Iterate over time stamps (ns) and the true boxes of all actors; nothing where the truth is not known."""
        return self._values(topics.TRUE_ACTORS, codec.read_actors)

    def moments(self) -> Iterator[Moment]:
        """Iterate over all that the log holds, moment by moment, in the order of time."""
        cameras = self.scene.cameras
        return gather_moments(self._decoded(moment_decoders(cameras)), cameras)

    def pictures(self, cameras: Iterable[str], channels: Iterable[str]) -> Iterator[Picture]:
        """Iterate over the pictures of some channels of some cameras in the order of time."""
        wanted = picture_topics(cameras, channels)
        for topic, stamp_ns, png in self._decoded(dict.fromkeys(wanted, codec.read_image)):
            yield Picture(stamp_ns, *wanted[topic], png)

    def frames(self, camera: str, *, images: bool = False) -> Iterator[CameraFrame]:
        """Iterate over the frames of a camera in the order of time, one chunk of the file in memory at once.

        Messages of equal stamps make a frame. A frame without label, or truth, has None there; one without disparity,
        which could not be placed in the world, is left out.

        Args:
            camera: its name.
            images: whether to read the colour images as well.

        Raises:
            LogError: there is no such camera.
        """
        self.choose_camera(camera)
        channels = [channel for channel in topics.PICTURE_FIELDS if images or channel != topics.IMAGE]
        return (frame for _, frame in camera_frames(self.pictures([camera], channels)))

    def messages(self, names: Iterable[str]) -> Iterator[Entry]:
        """Iterate over topic, time (ns) and data of some topics' messages, in the order of time, then of the file."""
        return self._container.entries(names)

    def source_files(self) -> dict[str, bytes]:
        """Return the source's files that are kept for the record, by name."""
        return self._container.attachments()

    def _decoded(self, decoders: Mapping[str, Callable[[bytes], Any]]) -> Iterator[Decoded]:
        """Iterate over what the messages of some topics say; `decoders` maps topics to what reads their messages."""
        for topic, stamp_ns, data in self.messages(decoders):
            with damage_as_log_error(self.path):
                value = decoders[topic](data)
            yield Decoded(topic, stamp_ns, value)

    def _values(self, topic: str, decode: Callable[[bytes], T]) -> Iterator[T]:
        return (decoded.value for decoded in self._decoded({topic: decode}))

    def _first(self, topic: str) -> bytes:
        entry = next(self._container.entries([topic]), None)
        if entry is None:
            raise LogError("has no message", path=self.path, field=topic)
        return entry.data
