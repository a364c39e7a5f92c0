"""Write a recording as an MCAP log, find logs, and read them back moment by moment."""

import math
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from semgrid_eval.classes import label_palette
from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import atomic_file
from semgrid_eval.frames.png import read_header, with_palette
from semgrid_eval.frames.types import Actor, CameraCalibration, CameraFrame, Moment, MotionSample, Pose, Recording
from semgrid_eval.log import codec, topics
from semgrid_eval.log.container import Container, Entry, damage_as_log_error
from semgrid_eval.log.motion import DeadReckoning
from semgrid_eval.log.scene import RECORD, Scene
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.log.writer import MessageWriter

SUFFIX = ".mcap"
T = TypeVar("T")


def find_logs(folder: Path) -> list[Path]:
    """List all logs below a folder, sorted by path; hidden files are left out.

    Raises:
        InputError: the folder does not exist or holds no log.
    """
    found = sorted(path for path in folder.rglob(f"*{SUFFIX}") if not path.name.startswith("."))
    if not found:
        raise InputError("holds no .mcap log" if folder.is_dir() else "is no folder", path=folder)
    return found


def write_log(recording: Recording, path: Path) -> None:
    """Write a recording to `path`, moment by moment; an error leaves nothing behind.

    Raises:
        InputError: the source is at fault, its moments are not in the order of time, or the file cannot be written.
    """
    scene = Scene(
        name=recording.name,
        dataset=recording.dataset,
        split=recording.split,
        cameras=tuple(sorted(recording.calibrations)),
        source_digest=recording.source_digest,
    )
    with atomic_file(path) as stream, MessageWriter(stream) as writer:
        writer.metadata(RECORD, scene.to_metadata())
        for name, data in sorted(recording.source_files.items()):
            writer.attach(name, _media_type(name), data)
        _RecordingWriter(writer, recording).write()


class _RecordingWriter:
    """Writes the moments of one recording."""

    def __init__(self, writer: MessageWriter, recording: Recording) -> None:
        self._writer = writer
        self._recording = recording
        self._reckoning = DeadReckoning()
        self._palette = label_palette()
        self._last_ns = -1

    def write(self) -> None:
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
            self._reckoning.add(sample)
            self._writer.write(topics.EGO_MOTION, codec.motion_message(sample), log_ns=sample.stamp_ns)

    def _vehicle(self, moment: Moment) -> None:
        now_ns = moment.stamp_ns
        pose = self._reckoning.pose_at(now_ns)
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
        for field, (channel, notes) in topics.PICTURES.items():
            png: bytes | None = getattr(frame, field)
            if png is None:
                continue
            if channel in (topics.LABEL, topics.EXACT_LABEL):
                png = with_palette(png, self._palette)
            if channel == topics.IMAGE:
                self._writer.end_chunk()
            message = codec.image_message(frame.stamp_ns, camera, png)
            self._writer.write(camera_topic(camera, channel), message, log_ns=frame.stamp_ns, notes=notes)
        self._writer.end_chunk()


class LogReader:
    """One log, read lazily; closes its file with its block, or by `close`.

    Raises:
        LogError: the file cannot be read, is damaged, was not written to the end, or is no log of this package.
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

    def verify(self) -> None:
        """Hold the checksum of everything in the file against its bytes.

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
            LogError: what is read is damaged, or the index tells another number of messages.
        """
        found: dict[str, list[int]] = {topic: [] for topic in self.schemas()}
        for entry in self._container.entries():
            found[self._topic(entry)].append(entry.log_ns)
        count = sum(len(stamps) for stamps in found.values())
        if count != self._container.message_count:
            raise LogError(
                f"holds {count} messages, but its index tells {self._container.message_count}", path=self.path
            )
        return found

    def calibration(self, camera: str) -> CameraCalibration:
        """Return the calibration of a camera.

        Raises:
            LogError: there is no such camera, or its calibration is damaged or impossible.
        """
        self._require_camera(camera)
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
        samples = list(self._decoded(topics.EGO_MOTION, codec.read_motion))
        for sample in samples:
            if not (math.isfinite(sample.speed_mps) and math.isfinite(sample.yaw_rate_radps)):
                raise LogError(f"is not finite at {sample.stamp_ns} ns", path=self.path, field=topics.EGO_MOTION)
        return samples

    def poses(self) -> list[Pose]:
        """Return the true poses in the order of time; none where the truth is not known.

        Raises:
            LogError: a pose is damaged.
        """
        return list(self._decoded(topics.TRUE_POSE, codec.read_pose))

    def actors(self) -> Iterator[tuple[int, tuple[Actor, ...]]]:
        """Iterate over time stamps (ns) and the true boxes of all actors; nothing where the truth is not known.

        Raises:
            LogError: what is read is damaged.
        """
        return self._decoded(topics.TRUE_ACTORS, codec.read_actors)

    def frames(self, camera: str, *, images: bool = False) -> Iterator[CameraFrame]:
        """Iterate over the frames of a camera in the order of time, one chunk of the file in memory at once.

        Messages of equal stamps make a frame. A frame without label, or truth, has None there; one without disparity,
        which could not be placed in the world, is left out.

        Args:
            camera: its name.
            images: whether to read the colour images, too.

        Raises:
            LogError: there is no such camera, or what is read is damaged.
        """
        self._require_camera(camera)
        fields = {camera_topic(camera, channel): field for field, (channel, _) in topics.PICTURES.items()}
        if not images:
            del fields[camera_topic(camera, topics.IMAGE)]
        for stamp_ns, entries in groupby(self._container.entries(fields), key=lambda entry: entry.log_ns):
            pictures = {fields[self._topic(entry)]: self._picture(entry) for entry in entries}
            if "disparity_png" in pictures:
                yield CameraFrame(
                    stamp_ns=stamp_ns,
                    image_png=pictures.pop("image_png", None),
                    label_png=pictures.pop("label_png", None),
                    **pictures,
                )

    def _require_camera(self, camera: str) -> None:
        if camera not in self.scene.cameras:
            raise LogError(f"{camera} is not one of: {', '.join(self.scene.cameras)}", path=self.path, field="camera")

    def _topic(self, entry: Entry) -> str:
        return self._container.summary.channels[entry.channel_id].topic

    def _picture(self, entry: Entry) -> bytes:
        with damage_as_log_error(self.path):
            return bytes(CompressedImage.FromString(entry.data).data)

    def _decoded(self, topic: str, decode: Callable[[bytes], T]) -> Iterator[T]:
        for entry in self._container.entries([topic]):
            with damage_as_log_error(self.path):
                value = decode(entry.data)
            yield value

    def _first(self, topic: str) -> bytes:
        for entry in self._container.entries([topic]):
            return entry.data
        raise LogError("has no message", path=self.path, field=topic)


def _media_type(name: str) -> str:
    return "application/json" if name.endswith(".json") else "application/octet-stream"
