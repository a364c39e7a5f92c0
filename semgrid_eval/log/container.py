"""Read an MCAP file safely: indexed, bounded in memory, checksums verified, one error for all damage."""

import hashlib
import heapq
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from mcap import records
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import DIGEST_CHARACTERS, digest_files, open_regular
from semgrid_eval.log.records import (
    DAMAGE,
    HEADER,
    MAGIC,
    MAX_CHUNK_BYTES,
    data_crc,
    read_at,
    read_attachment,
    read_chunk,
    read_index,
    read_metadata,
    unpack_chunk,
)

MAX_STAMP_NS = 1 << 63
_BLOCK_BYTES = 1 << 20


@contextmanager
def damage_as_log_error(path: Path, field: str | None = None) -> Iterator[None]:
    """Turn whatever a damaged file makes the libraries raise into a `LogError` that names the file, and the field."""
    try:
        yield
    except OSError as error:
        raise LogError(f"cannot be read: {error.strerror or error}", path=path) from error
    except DAMAGE as error:
        raise LogError(f"is damaged: {str(error) or type(error).__name__}", path=path, field=field) from error


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
        if not self._index.data_crc:
            return digest_files([self.path], limit=sys.maxsize)
        return hashlib.sha256(self._index.tail).hexdigest()[:DIGEST_CHARACTERS]

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
            return read_metadata(body).metadata

    def attachments(self) -> dict[str, bytes]:
        """Return the attached files by name, which are the source's, kept for the record; no two may have one name."""
        found: dict[str, bytes] = {}
        for index in self.summary.attachment_indexes:
            with damage_as_log_error(self.path):
                if index.name in found:
                    raise McapError(f"two attachments are called {index.name!r}")
                body = self._record(Opcode.ATTACHMENT, index.offset, index.length)
                found[index.name] = read_attachment(body).data
        return found

    def verify(self) -> None:
        """Compare the checksum of all data, where the writer did not leave it out, with the bytes."""
        if not self._index.data_crc:
            return
        with damage_as_log_error(self.path):
            crc = data_crc(self._stream, self._index.data_end)
        if crc != self._index.data_crc:
            raise LogError("is damaged: the checksum of its data does not match", path=self.path)

    def _load(self) -> None:
        if self._stream.read(len(MAGIC)) != MAGIC:
            raise McapError("it does not begin as an MCAP file")
        self._index = read_index(self._stream)
        self.summary = self._index.summary
        self.has_checksums = bool(self._index.summary_crc and self._index.data_crc)
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
        chunk = read_chunk(body)
        declared = (index.compression, index.compressed_size, index.uncompressed_size)
        if (chunk.compression, len(chunk.data), chunk.uncompressed_size) != declared:
            raise McapError("a chunk is not what the index says")
        return unpack_chunk(chunk)

    def _record(self, opcode: Opcode, offset: int, length: int) -> bytes:
        """Read the body of the record that an index entry points at."""
        if not len(MAGIC) <= offset <= offset + length <= self._index.data_end or length > MAX_CHUNK_BYTES:
            raise McapError("its index points outside the file")
        record = read_at(self._stream, offset, length)
        if HEADER.unpack_from(record) != (opcode, length - HEADER.size):
            raise McapError(f"its index points at something that is not a {opcode.name.lower()}")
        return record[HEADER.size :]


def _may_hold(index: records.ChunkIndex, wanted: Iterable[int]) -> bool:
    channels = index.message_index_offsets
    return not channels or any(number in channels for number in wanted)
