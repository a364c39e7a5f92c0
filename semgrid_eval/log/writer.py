"""Write recordings as messages to an MCAP stream: all indexes, all checksums, and equal bytes for equal input."""

from collections import Counter
from types import TracebackType
from typing import BinaryIO, Self

from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from google.protobuf.message import Message
from mcap.writer import CompressionType, IndexType, Writer

from semgrid_eval import __version__
from semgrid_eval.errors import InputError, located
from semgrid_eval.labels import label_palette
from semgrid_eval.log import codec, topics
from semgrid_eval.log.calibrations import calibration_messages
from semgrid_eval.log.container import MAX_STAMP_NS
from semgrid_eval.log.sweeps import sweep_message
from semgrid_eval.log.topics import camera_topic, lidar_topic
from semgrid_eval.motion import EgoMotion, implausible
from semgrid_eval.recording.colour import ImageSize, read_size, require_whole
from semgrid_eval.recording.lidar import LidarSweep
from semgrid_eval.recording.png import read_header, require_pixels, with_palette
from semgrid_eval.recording.types import CameraCalibration, CameraFrame, Moment, Recording

CHUNK_BYTES = 1 << 20
LIBRARY = f"semgrid-eval/{__version__}"


def open_writer(stream: BinaryIO) -> Writer:
    """Return a writer of chunks with all indexes and all checksums."""
    return Writer(
        stream,
        chunk_size=CHUNK_BYTES,
        compression=CompressionType.ZSTD,
        index_types=IndexType.ALL,
        enable_crcs=True,
        enable_data_crcs=True,
    )


class MessageWriter:
    """Registers a channel at the first message of its topic; finishes the log when its block ends without error."""

    def __init__(self, stream: BinaryIO) -> None:
        self._writer = open_writer(stream)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[int] = Counter()

    def __enter__(self) -> Self:
        self._writer.start(profile="", library=LIBRARY)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if error is None:
            self._writer.finish()  # type: ignore[no-untyped-call]

    def metadata(self, name: str, entries: dict[str, str]) -> None:
        """Write a metadata record."""
        self._writer.add_metadata(name, entries)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment; it carries no time, since a file's own would change between equal conversions."""
        self._writer.add_attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data)

    def write(
        self,
        topic: str,
        message: Message,
        *,
        log_ns: int,
        publish_ns: int | None = None,
        notes: dict[str, str] | None = None,
    ) -> None:
        """Write one message.

        Args:
            topic: all messages of a topic are of one type.
            message: what it says.
            log_ns: the time it holds for.
            publish_ns: when it could be known, if that is another time.
            notes: metadata of the channel, used at the first message of the topic.
        """
        if topic not in self._channels:
            schema = self._schema(message)
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema, notes or {})
        channel = self._channels[topic]
        self._writer.add_message(
            channel,
            log_time=log_ns,
            publish_time=log_ns if publish_ns is None else publish_ns,
            data=message.SerializeToString(deterministic=True),
            sequence=self._counts[channel],
        )
        self._counts[channel] += 1

    def end_chunk(self) -> None:
        """Begin a new chunk, so that a reader can skip what follows, or what came before, without unpacking it."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def _schema(self, message: Message) -> int:
        name = message.DESCRIPTOR.full_name
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "protobuf", _file_descriptor_set(message))
        return self._schemas[name]


def _file_descriptor_set(message: Message) -> bytes:
    """Serialise the .proto file of a message with all its imports, each after what it imports."""
    files: dict[str, FileDescriptorProto] = {}
    pending = [message.DESCRIPTOR.file]
    while pending:
        file = pending.pop()
        files.pop(file.name, None)  # whatever is met again moves to the end, behind all that import it
        files[file.name] = FileDescriptorProto.FromString(file.serialized_pb)
        pending.extend(file.dependencies)
    return FileDescriptorSet(file=reversed(files.values())).SerializeToString(deterministic=True)


class MomentWriter:
    """Writes the moments of a recording as messages."""

    def __init__(self, writer: MessageWriter, recording: Recording) -> None:
        self._writer = writer
        self._recording = recording
        self._ego_motion = EgoMotion()  # as far as it is known by each moment
        self._palette = label_palette()
        self._sizes_px: dict[str, ImageSize] = {}  # that cameras are calibrated for
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
            for lidar in sorted(moment.sweeps):
                self._sweep(lidar, moment.sweeps[lidar])
            count += 1
        if not count:
            raise InputError("holds no frame", field=self._recording.name)

    def _advance(self, stamp_ns: int, what: str) -> None:
        if stamp_ns >= MAX_STAMP_NS:
            raise InputError(f"{what} at {stamp_ns} ns is beyond 2^63 ns", field=f"{self._recording.name}: stamp_ns")
        if stamp_ns < self._last_ns:
            message = f"{what} at {stamp_ns} ns comes after {self._last_ns} ns"
            raise InputError(message, field=f"{self._recording.name}: stamp_ns")
        self._last_ns = stamp_ns

    def _motion(self, moment: Moment) -> None:
        for sample in moment.motion:
            self._advance(sample.stamp_ns, "motion sample")
            if fault := implausible(sample):
                place = f"{self._recording.name}: motion at {sample.stamp_ns} ns: {fault[0]}"
                raise InputError(fault[1], field=place)
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
        calibration = self._recording.calibrations[camera]
        with located(field=f"{self._recording.name}: camera {camera} at {frame.stamp_ns} ns"):
            _require_sound(frame, calibration)
        pictures = {
            channel: png
            for field, (channel, _) in topics.PICTURES.items()
            if (png := getattr(frame, field)) is not None
        }
        sizes = {channel: self._whole(camera, channel, png, frame.stamp_ns) for channel, png in pictures.items()}
        size_px = self._calibrated_px(camera, frame.stamp_ns, sizes)
        known, rest = calibration_messages(frame.stamp_ns, camera, calibration, size_px)
        self._writer.write(camera_topic(camera, topics.CALIBRATION), known, log_ns=frame.stamp_ns)
        self._writer.write(camera_topic(camera, topics.STEREO), rest, log_ns=frame.stamp_ns)
        notes = dict(topics.PICTURES.values())
        for channel, png in pictures.items():
            shown = with_palette(png, self._palette) if channel in (topics.LABEL, topics.EXACT_LABEL) else png
            if channel == topics.IMAGE:
                self._writer.end_chunk()
            message = codec.image_message(frame.stamp_ns, camera, shown)
            self._writer.write(camera_topic(camera, channel), message, log_ns=frame.stamp_ns, notes=notes[channel])
        self._writer.end_chunk()

    def _calibrated_px(self, camera: str, stamp_ns: int, sizes: dict[str, ImageSize]) -> ImageSize:
        """Return the size that a calibration holds for: that of disparity or image, of labels where none came yet."""
        channel = next((each for each in (topics.DISPARITY, topics.IMAGE) if each in sizes), topics.LABEL)
        known_px = self._sizes_px.setdefault(camera, sizes[channel])
        if channel != topics.LABEL and sizes[channel] != known_px:
            place = f"{self._recording.name}: {camera_topic(camera, channel)} at {stamp_ns} ns"
            found = f"is {sizes[channel].width} x {sizes[channel].height}"
            raise InputError(f"{found}; pictures before it are {known_px.width} x {known_px.height}", field=place)
        return known_px

    def _sweep(self, lidar: str, sweep: LidarSweep) -> None:
        message = sweep_message(sweep)
        self._writer.end_chunk()
        topic = lidar_topic(lidar)
        self._writer.write(topic, message, log_ns=sweep.stamp_ns, notes=topics.SWEEP_NOTES)
        self._writer.end_chunk()

    def _whole(self, camera: str, channel: str, png: bytes, stamp_ns: int) -> ImageSize:
        """Make sure that a picture can be decoded, so that no log holds another; only colour may be JPEG."""
        with located(field=f"{self._recording.name}: {camera_topic(camera, channel)} at {stamp_ns} ns"):
            if channel == topics.IMAGE:
                return read_size(png) if self._recording.encoded_here else require_whole(png)
            header = read_header(png) if self._recording.encoded_here else require_pixels(png)
            return ImageSize(header.width, header.height)


def _require_sound(frame: CameraFrame, calibration: CameraCalibration) -> None:
    """Refuse disparity without a baseline, a baseline without disparity, and a frame of nothing."""
    disparity = frame.disparity_png or frame.exact_disparity_png
    if calibration.baseline_m is None and disparity is not None:
        raise InputError("has disparity, but its calibration no baseline_m")
    if calibration.baseline_m is not None and frame.disparity_png is None:
        raise InputError("has no disparity; the calibration of a camera without has no baseline_m either")
    if frame.disparity_png is frame.image_file is frame.label_png is None:
        raise InputError("has neither disparity nor image nor labels")
