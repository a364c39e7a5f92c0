"""Read an MCAP file safely: indexed, bounded in memory, checksums verified, one error for all damage."""

import hashlib
import heapq
import io
import struct
import sys
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, NamedTuple, Self

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from google.protobuf.message import DecodeError
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC as MAGIC

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import DIGEST_CHARACTERS, digest_files, open_regular

MAX_CHUNK_BYTES = 1 << 30
MAX_STAMP_NS = 1 << 63
_BLOCK_BYTES = 1 << 20
_HEADER = struct.Struct("<BQ")  # opcode and length of any record
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")
_DAMAGE = (
    *(McapError, DecodeError, zstandard.ZstdError, struct.error),
    *(EOFError, LookupError, OverflowError, MemoryError, RuntimeError, ValueError),
)


@contextmanager
def damage_as_log_error(path: Path) -> Iterator[None]:
    """Turn whatever a damaged file makes the libraries raise into a `LogError` that names the file."""
    try:
        yield
    except OSError as error:
        raise LogError(f"cannot be read: {error.strerror or error}", path=path) from error
    except _DAMAGE as error:
        raise LogError(f"is damaged: {str(error) or type(error).__name__}", path=path) from error


class Entry(NamedTuple):
    """One message as it is stored in the file."""

    topic: str
    log_ns: int
    data: bytes
    publish_ns: int


class Container:
    """An open MCAP file whose summary was read and checked; closes its file with its block, or by `close`.

    `has_checksums` says whether the writer gave checksums of data and index, so that any damage is seen.

    Raises:
        LogError: the file cannot be read, is not an MCAP file, ends early or has no index; damage that only shows when
            more is read is raised then, by every method that reads.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._stream = open_regular(path, limit=sys.maxsize)
        except InputError as error:
            raise LogError(str(error).removeprefix(f"{path}: "), path=path) from error
        with damage_as_log_error(path):
            try:
                self._load()
            except BaseException:
                self.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    @property
    def digest(self) -> str:
        """Digest of the file's own index and checksum of its data (16 hexadecimal characters).

        The bytes themselves are hashed only where the writer left that checksum out.
        """
        if not self._data_crc:
            return digest_files([self.path], limit=sys.maxsize)
        return hashlib.sha256(self._tail).hexdigest()[:DIGEST_CHARACTERS]

    def messages(self, topics: Iterable[str] | None = None) -> Iterator[Entry]:
        """Iterate over the messages of some topics, or of all, in the order of time, then of the file."""
        channels = self.summary.channels
        names = None if topics is None else set(topics)
        wanted = {number: each.topic for number, each in channels.items() if names is None or each.topic in names}
        chunks = [index for index in self.summary.chunk_indexes if _may_hold(index, wanted)]
        chunks.sort(key=lambda index: (index.message_start_time, index.chunk_start_offset))
        starts_ns = [index.message_start_time for index in chunks[1:]]
        heap: list[tuple[int, int, int, Entry]] = []
        for order, index in enumerate(chunks):
            for place, entry in enumerate(self._chunk_entries(index, wanted)):
                heapq.heappush(heap, (entry.log_ns, order, place, entry))
            while heap and (order == len(starts_ns) or heap[0][0] <= starts_ns[order]):
                yield heapq.heappop(heap)[-1]

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the entries of the one metadata record of this name, None where there is none."""
        found = [index for index in self.summary.metadata_indexes if index.name == name]
        if not found:
            return None
        if len(found) > 1:
            raise LogError(f"has {len(found)} metadata records {name}", path=self.path)
        with damage_as_log_error(self.path):
            body = self._record(Opcode.METADATA, found[0].offset, found[0].length)
            record: records.Metadata = records.Metadata.read(ReadDataStream(io.BytesIO(body)))
            return record.metadata

    def attachments(self) -> dict[str, bytes]:
        """Return the attached files by name, which are the source's, kept for the record; no two may have one name."""
        found: dict[str, bytes] = {}
        for index in self.summary.attachment_indexes:
            with damage_as_log_error(self.path):
                if index.name in found:
                    raise McapError(f"two attachments are called {index.name!r}")
                body = self._record(Opcode.ATTACHMENT, index.offset, index.length)
                crc = int.from_bytes(body[-4:], "little")
                if crc and crc != zlib.crc32(body[:-4]):
                    raise McapError(f"the checksum of attachment {index.name!r} does not match")
                attachment: records.Attachment = records.Attachment.read(ReadDataStream(io.BytesIO(body)))
                found[index.name] = attachment.data
        return found

    def verify(self) -> None:
        """Compare the checksum of all data, where the writer did not leave it out, with the bytes."""
        if not self._data_crc:
            return
        crc, left = 0, self._data_end
        with damage_as_log_error(self.path):
            self._stream.seek(0)
            while left:
                block = _exactly(self._stream, min(left, _BLOCK_BYTES))
                crc = zlib.crc32(block, crc)
                left -= len(block)
        if crc != self._data_crc:
            raise LogError("is damaged: the checksum of its data does not match", path=self.path)

    def _load(self) -> None:
        size = self._stream.seek(0, io.SEEK_END)
        if self._read(0, len(MAGIC)) != MAGIC:
            raise McapError("it does not begin as an MCAP file")
        footer_at = size - len(MAGIC) - _FOOTER.size
        ending = self._read(max(footer_at, 0), _FOOTER.size + len(MAGIC))
        opcode, length, summary_start, _, summary_crc = _FOOTER.unpack_from(ending)
        if ending[_FOOTER.size :] != MAGIC or opcode != Opcode.FOOTER or length != _FOOTER.size - _HEADER.size:
            raise McapError("its end is missing; it was not written to the end, or was cut")
        self._data_end = summary_start - _DATA_END.size
        if not len(MAGIC) <= self._data_end < summary_start <= footer_at:
            raise McapError("it has no index")
        self._tail = self._read(self._data_end, size - self._data_end)
        opcode, length, self._data_crc = _DATA_END.unpack_from(self._tail)
        if opcode != Opcode.DATA_END or length != _DATA_END.size - _HEADER.size:
            raise McapError("its index does not begin where it should")
        summary = self._tail[_DATA_END.size :]
        self.has_checksums = bool(summary_crc and self._data_crc)
        if summary_crc and zlib.crc32(summary[: -len(MAGIC) - 4]) != summary_crc:
            raise McapError("the checksum of its index does not match")
        self.summary = _parse_summary(summary)
        statistics = self.summary.statistics
        if statistics is None or statistics.chunk_count != len(self.summary.chunk_indexes):
            raise McapError("its index is incomplete")
        if any(index.message_end_time >= MAX_STAMP_NS for index in self.summary.chunk_indexes):
            raise McapError("it has times of 2^63 ns or more, which are some 292 years")
        self.message_count = statistics.message_count

    def _chunk_entries(self, index: records.ChunkIndex, wanted: Mapping[int, str]) -> Iterator[Entry]:
        with damage_as_log_error(self.path):
            found = [record for record in self._chunk_records(index) if isinstance(record, records.Message)]
            for message in found:
                if message.channel_id not in self.summary.channels:
                    raise McapError(f"a message belongs to the unknown channel {message.channel_id}")
                if not index.message_start_time <= message.log_time <= index.message_end_time:
                    raise McapError("a message is outside the times that the index gives")
        for message in found:
            if message.channel_id in wanted:
                yield Entry(wanted[message.channel_id], message.log_time, message.data, message.publish_time)

    def _chunk_records(self, index: records.ChunkIndex) -> list[records.McapRecord]:
        body = self._record(Opcode.CHUNK, index.chunk_start_offset, index.chunk_length)
        chunk = records.Chunk.read(ReadDataStream(io.BytesIO(body)))
        declared = (index.compression, index.compressed_size, index.uncompressed_size)
        if (chunk.compression, len(chunk.data), chunk.uncompressed_size) != declared:
            raise McapError("a chunk is not what the index says")
        chunk.data = _decompress(chunk)
        chunk.compression = ""
        return breakup_chunk(chunk, validate_crc=True)

    def _record(self, opcode: Opcode, offset: int, length: int) -> bytes:
        """Read the body of the record that an index entry points at."""
        if not len(MAGIC) <= offset <= offset + length <= self._data_end or length > MAX_CHUNK_BYTES:
            raise McapError("its index points outside the file")
        record = self._read(offset, length)
        if _HEADER.unpack_from(record) != (opcode, length - _HEADER.size):
            raise McapError(f"its index points at something that is not a {opcode.name.lower()}")
        return record[_HEADER.size :]

    def _read(self, offset: int, length: int) -> bytes:
        self._stream.seek(offset)
        return _exactly(self._stream, length)


def _exactly(stream: BinaryIO, length: int) -> bytes:
    data = stream.read(length)
    if len(data) != length:
        raise McapError("it ends early")
    return data


def _may_hold(index: records.ChunkIndex, wanted: Iterable[int]) -> bool:
    channels = index.message_index_offsets
    return not channels or any(number in channels for number in wanted)


def _decompress(chunk: records.Chunk) -> bytes:
    """Unpack a chunk into exactly the size it declares, never allocating more."""
    size = chunk.uncompressed_size
    if size > MAX_CHUNK_BYTES:
        raise McapError(f"a chunk of {size} bytes is larger than any log needs")
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(chunk.data) not in (-1, size):
            raise McapError("a chunk is not of the size it declares")
        data = zstandard.decompress(chunk.data, max_output_size=size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise McapError(f"a chunk is compressed by the unknown method {chunk.compression!r}")
    if len(data) != size:
        raise McapError("a chunk is not of the size it declares")
    return data


def _parse_summary(summary: bytes) -> Summary:
    result = Summary()
    for record in StreamReader(io.BytesIO(summary), skip_magic=True, record_size_limit=len(summary)).records:
        match record:
            case records.Schema():
                result.schemas[record.id] = record
            case records.Channel():
                result.channels[record.id] = record
            case records.ChunkIndex():
                result.chunk_indexes.append(record)
            case records.AttachmentIndex():
                result.attachment_indexes.append(record)
            case records.MetadataIndex():
                result.metadata_indexes.append(record)
            case records.Statistics():
                result.statistics = record
    return result
