"""Write protobuf messages to an MCAP stream: all indexes, all checksums, and equal bytes for equal input."""

from collections import Counter
from types import TracebackType
from typing import BinaryIO, Self

from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from google.protobuf.message import Message
from mcap.writer import CompressionType, IndexType, Writer

from semgrid_eval import __version__

CHUNK_BYTES = 1 << 20


class MessageWriter:
    """Registers a channel at the first message of its topic; finishes the log when its block ends without error."""

    def __init__(self, stream: BinaryIO) -> None:
        self._writer = Writer(
            stream,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            index_types=IndexType.ALL,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[int] = Counter()

    def __enter__(self) -> Self:
        self._writer.start(profile="", library=f"semgrid-eval/{__version__}")
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
