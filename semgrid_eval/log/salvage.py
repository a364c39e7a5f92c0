"""Find what is whole in a damaged MCAP file, record by record; nothing is believed that a checksum could prove.

Chunks and attachments have checksums of their own, and count only where those hold. Other records outside chunks never
have one; they count where they are reached from a whole record and end where they say. Where the way is lost, only what
proves itself is found again, so that the content of a damaged chunk is never taken for records.
"""

import errno
import io
import os
import re
from collections.abc import Iterable, Iterator
from typing import Any, BinaryIO, NamedTuple

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from semgrid_eval.log.records import (
    DAMAGE,
    HEADER,
    MAGIC,
    MAX_CHUNK_BYTES,
    Index,
    read_at,
    read_attachment,
    read_chunk,
    read_index,
    unpack_chunk,
)

_BLOCK_BYTES = 1 << 20
_MESSAGE_BYTES = 22  # before its data
_CHUNK_BYTES, _ATTACHMENT_BYTES = 40, 36  # besides what is of variable length
_READERS: dict[int, Any] = {
    Opcode.HEADER: records.Header,
    Opcode.FOOTER: records.Footer,
    Opcode.SCHEMA: records.Schema,
    Opcode.CHANNEL: records.Channel,
    Opcode.MESSAGE_INDEX: records.MessageIndex,
    Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.ATTACHMENT_INDEX: records.AttachmentIndex,
    Opcode.STATISTICS: records.Statistics,
    Opcode.METADATA: records.Metadata,
    Opcode.METADATA_INDEX: records.MetadataIndex,
    Opcode.SUMMARY_OFFSET: records.SummaryOffset,
    Opcode.DATA_END: records.DataEnd,
}
_NEVER_IN_CHUNKS = (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA, Opcode.MESSAGE_INDEX, Opcode.DATA_END)
_LAST = (Opcode.DATA_END, Opcode.FOOTER)
_UNPROVED = "a chunk has no checksum, so nothing shows that it is whole"
_UNMATCHED = "a chunk does not match its checksum"
_OF_ITS_SIZE = (_UNPROVED, _UNMATCHED)
"""Faults of chunks whose inner size agrees, so that they end where they say."""
# Opcode and length of what proves itself; no such record has 2^40 bytes.
_PROVABLE = re.compile(rb"[\x06\x09\x0f](?=.{5}\x00{3})", re.DOTALL)


class Part(NamedTuple):
    """A whole record from byte `begin` to `end`."""

    opcode: int
    begin: int
    end: int


class Hole(NamedTuple):
    """A stretch of bytes that holds no whole record, and why; `opcode` where it is known to be one damaged record."""

    begin: int
    end: int
    reason: str
    opcode: int | None = None


def surviving_index(stream: BinaryIO) -> Index | None:
    """Read the index of a file, None where it is damaged or has no checksum to prove that it is not."""
    try:
        index = read_index(stream)
    except DAMAGE:
        return None
    return index if index.summary_crc else None


def walk(stream: BinaryIO, index: Index | None, *, proved: bool = False) -> Iterator[Part | Hole]:
    """Iterate over all bytes of a file up to the end of its data, as whole records and what lies between them.

    With an index, records are found again where it says. `proved` says that the checksum of all data holds, which
    stands in for those that chunks and attachments lack.
    """
    return _Walk(stream, index, proved=proved).steps()


def body_of(stream: BinaryIO, part: Part) -> bytes:
    """Read what a record says."""
    return read_at(stream, part.begin + HEADER.size, part.end - part.begin - HEADER.size)


class _Walk:
    def __init__(self, stream: BinaryIO, index: Index | None, *, proved: bool) -> None:
        self._stream, self._proved = stream, proved
        self._size = stream.seek(0, io.SEEK_END)
        self._end = self._size if index is None else index.data_end + HEADER.size + 4
        self._anchors = None if index is None else sorted(_anchors(index))

    def steps(self) -> Iterator[Part | Hole]:
        at = min(len(MAGIC), self._end)
        while at < self._end:
            step = self._step(at)
            yield step
            at = step.end
            if isinstance(step, Part) and step.opcode in _LAST:
                return

    def _step(self, at: int) -> Part | Hole:
        try:
            part = self._part(at)
        except McapError as error:
            return Hole(at, self._found_again(at + 1), str(error))
        reason = self._fault(part)
        if not reason:
            return part
        if reason in _OF_ITS_SIZE or self._is_framed(part):
            return Hole(at, part.end, reason, part.opcode)
        return Hole(at, self._found_again(at + 1), reason)

    def _part(self, at: int) -> Part:
        """Read where a record ends, if it does so within the file."""
        if at + HEADER.size > self._end:
            raise McapError("the file ends within a record")
        opcode, length = HEADER.unpack(read_at(self._stream, at, HEADER.size))
        end = at + HEADER.size + length
        if opcode not in _READERS and opcode not in (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.MESSAGE):
            raise McapError("there is no record where one should begin")
        if end > self._end:
            raise McapError("a record ends beyond the file, or the file within it")
        if length > MAX_CHUNK_BYTES:
            raise McapError("a record is larger than any log needs")
        return Part(opcode, at, end)

    def _fault(self, part: Part) -> str:
        """Say why a record is not whole; empty where it is."""
        body = body_of(self._stream, part)
        try:
            if part.opcode == Opcode.CHUNK:
                return self._chunk_fault(body)
            if part.opcode == Opcode.ATTACHMENT:
                return self._attachment_fault(body)
            if part.opcode == Opcode.MESSAGE:
                whole = len(body) >= _MESSAGE_BYTES and self._is_followed(part.end)
                return "" if whole else "a message outside chunks does not end where a record begins"
            stream = ReadDataStream(io.BytesIO(body))
            _READERS[part.opcode].read(stream)
        except DAMAGE:
            return f"{_name(part.opcode)} cannot be read"
        return "" if stream.count == len(body) else f"{_name(part.opcode)} does not end where it says"

    def _chunk_fault(self, body: bytes) -> str:
        chunk = read_chunk(body)
        if len(body) != _CHUNK_BYTES + len(chunk.compression.encode()) + len(chunk.data):
            return "a chunk is not of the size it declares"
        if not chunk.uncompressed_crc and not self._proved:
            return _UNPROVED
        try:
            unpack_chunk(chunk)
        except DAMAGE:
            return _UNMATCHED
        return ""

    def _attachment_fault(self, body: bytes) -> str:
        found = read_attachment(body)
        names = len(found.name.encode()) + len(found.media_type.encode())
        if len(body) != _ATTACHMENT_BYTES + names + len(found.data):
            return "an attachment is not of the size it declares"
        if not int.from_bytes(body[-4:], "little") and not self._proved:
            return "an attachment has no checksum, so nothing shows that it is whole"
        return ""

    def _is_framed(self, part: Part) -> bool:
        """Tell whether a damaged record ends where it says: another record follows."""
        try:
            after = self._part(part.end)
        except McapError:
            return False
        return after.opcode in _NEVER_IN_CHUNKS and not self._fault(after)

    def _is_followed(self, at: int) -> bool:
        try:
            return at == self._end or bool(self._part(at))
        except McapError:
            return False

    def _found_again(self, at: int) -> int:
        """Return where the next record begins that proves itself, or the end."""
        candidates = self._search(at) if self._anchors is None else (each for each in self._anchors if each >= at)
        for begin in candidates:
            try:
                part = self._part(begin)
            except McapError:
                continue
            if not self._fault(part) and (part.opcode not in _LAST or self._is_followed(part.end)):
                return begin
        return self._end

    def _search(self, at: int) -> Iterator[int]:
        while (at := _data_from(self._stream, at, self._end)) < self._end:
            self._stream.seek(at)
            block = self._stream.read(_BLOCK_BYTES + HEADER.size)
            for found in _PROVABLE.finditer(block):
                if found.start() < _BLOCK_BYTES:
                    yield at + found.start()
            at += _BLOCK_BYTES


def _data_from(stream: BinaryIO, at: int, end: int) -> int:
    """Return the first place from here on that is not in a hole of a sparse file, which reads as zeros."""
    if not hasattr(os, "SEEK_DATA"):
        return at
    descriptor = stream.fileno()
    before = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        return os.lseek(descriptor, at, os.SEEK_DATA)
    except OSError as error:  # there are no more data, or the file system does not tell
        return end if error.errno == errno.ENXIO else at
    finally:
        os.lseek(descriptor, before, os.SEEK_SET)  # where the stream believes it to be


def _anchors(index: Index) -> Iterable[int]:
    """Return where an index says that records begin: chunks, attachments, metadata and the end of the data."""
    summary = index.summary
    chunks = (each.chunk_start_offset for each in summary.chunk_indexes)
    attachments = (each.offset for each in summary.attachment_indexes)
    return {*chunks, *attachments, *(each.offset for each in summary.metadata_indexes), index.data_end}


def _name(opcode: int) -> str:
    return f"a record of kind {Opcode(opcode).name.lower().replace('_', ' ')}"
