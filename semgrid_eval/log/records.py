"""The records of an MCAP file: its index at the end, and chunks, unpacked within bounds and held against checksums.

What damage makes the functions raise is one of `DAMAGE`.
"""

import io
import struct
import zlib
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from google.protobuf.message import DecodeError
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC

MAGIC = MCAP0_MAGIC
MAX_CHUNK_BYTES = 1 << 30
HEADER = struct.Struct("<BQ")  # opcode and length of any record
DAMAGE = (
    *(McapError, DecodeError, zstandard.ZstdError, struct.error),
    *(EOFError, LookupError, OverflowError, MemoryError, RuntimeError, ValueError),
)
_BLOCK_BYTES = 1 << 20
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")


class Index(NamedTuple):
    """What stands at the end of a file: its summary, and where its data end; a checksum is 0 where there is none."""

    summary: Summary
    data_end: int  # bytes
    data_crc: int
    summary_crc: int
    tail: bytes  # all that follows the data


def read_index(stream: BinaryIO) -> Index:
    """Read the end of a file; where its summary has a checksum, it holds."""
    size = stream.seek(0, io.SEEK_END)
    footer_at = size - len(MAGIC) - _FOOTER.size
    ending = read_at(stream, max(footer_at, 0), _FOOTER.size + len(MAGIC))
    opcode, length, summary_start, _, summary_crc = _FOOTER.unpack_from(ending)
    if ending[_FOOTER.size :] != MAGIC or opcode != Opcode.FOOTER or length != _FOOTER.size - HEADER.size:
        raise McapError("its end is missing; it was not written to the end, or was cut")
    data_end = summary_start - _DATA_END.size
    if not len(MAGIC) <= data_end < summary_start <= footer_at:
        raise McapError("it has no index")
    tail = read_at(stream, data_end, size - data_end)
    opcode, length, data_crc = _DATA_END.unpack_from(tail)
    if opcode != Opcode.DATA_END or length != _DATA_END.size - HEADER.size:
        raise McapError("its index does not begin where it should")
    summary = tail[_DATA_END.size :]
    if summary_crc and zlib.crc32(summary[: -len(MAGIC) - 4]) != summary_crc:
        raise McapError("the checksum of its index does not match")
    return Index(_parse_summary(summary), data_end, data_crc, summary_crc, tail)


def read_at(stream: BinaryIO, offset: int, length: int) -> bytes:
    """Read so many bytes from a place in a file."""
    stream.seek(offset)
    return exactly(stream, length)


def data_crc(stream: BinaryIO, end: int) -> int:
    """Compute the checksum of all bytes up to a place."""
    crc, left = 0, end
    stream.seek(0)
    while left:
        block = exactly(stream, min(left, _BLOCK_BYTES))
        crc = zlib.crc32(block, crc)
        left -= len(block)
    return crc


def exactly(stream: BinaryIO, length: int) -> bytes:
    """Read so many bytes."""
    data = stream.read(length)
    if len(data) != length:
        raise McapError("it ends early")
    return data


def read_chunk(body: bytes) -> records.Chunk:
    """Read a chunk, still packed."""
    chunk: records.Chunk = records.Chunk.read(ReadDataStream(io.BytesIO(body)))
    return chunk


def unpack_chunk(chunk: records.Chunk) -> list[records.McapRecord]:
    """Return the schemas, channels and messages of a chunk; where it has a checksum, it holds."""
    chunk.data = _decompress(chunk)
    chunk.compression = ""
    try:
        return breakup_chunk(chunk, validate_crc=True)
    except CRCValidationError:
        raise McapError("the checksum of a chunk does not match") from None


def read_attachment(body: bytes) -> records.Attachment:
    """Read an attachment; where it has a checksum, it holds."""
    attachment: records.Attachment = records.Attachment.read(ReadDataStream(io.BytesIO(body)))
    crc = int.from_bytes(body[-4:], "little")
    if crc and crc != zlib.crc32(body[:-4]):
        raise McapError(f"the checksum of attachment {attachment.name!r} does not match")
    return attachment


def read_metadata(body: bytes) -> records.Metadata:
    """Read a metadata record, which never has a checksum."""
    metadata: records.Metadata = records.Metadata.read(ReadDataStream(io.BytesIO(body)))
    return metadata


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
