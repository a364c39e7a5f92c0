"""Logs whose container is at fault: index, chunks, checksums, records."""

import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from mcap.reader import make_reader
from mcap.writer import IndexType, Writer
from support.bad import logs
from support.bad.case import Bad, Kind
from support.damage import CHUNK, DATA_END, stretches

from semgrid_eval.log.codec import CONDITIONS_RECORD

LOG, GRIDS, CHECK = logs.LOG, logs.GRIDS, "check logs"
FOOTER = struct.Struct("<QQI")


def _written(change: Callable[[Writer], object], **options: Any) -> None:
    """Write the log again with these options of the writer, and something more in it."""
    with LOG.open("rb") as old, LOG.with_suffix(".new").open("wb") as stream:
        writer = Writer(stream, **{"enable_data_crcs": True, **options})
        writer.start(profile="", library="")
        logs.copy(make_reader(old), writer, logs.as_it_is, None, {})
        change(writer)
        writer.finish()
    LOG.with_suffix(".new").rename(LOG)


def _patched(change: Callable[[bytearray], object], *, seal_index: bool = True) -> None:
    """Change bytes of the log; the checksum of its index holds again, if wanted."""
    data = bytearray(LOG.read_bytes())
    change(data)
    if seal_index:
        (start, _, _) = FOOTER.unpack_from(data, len(data) - 8 - FOOTER.size)
        struct.pack_into("<I", data, len(data) - 12, zlib.crc32(data[start : len(data) - 12]))
    LOG.write_bytes(data)


def _chunk(data: bytes) -> int:
    return next(each.begin for each in stretches(data) if each.opcode == CHUNK)


def _at_chunk(offset: int, content: bytes) -> Callable[[bytearray], None]:
    """Put bytes so far into the first chunk: opcode 1, length 8, times 16, size 8, checksum 4, compression."""

    def change(data: bytearray) -> None:
        at = _chunk(bytes(data)) + offset
        data[at : at + len(content)] = content

    return change


def _footer(start: int) -> Callable[[bytearray], None]:
    return lambda data: struct.pack_into("<Q", data, len(data) - 8 - FOOTER.size, start)


def _in_index(opcode: int, offset: int, content: bytes) -> Callable[[bytearray], None]:
    """Put bytes so far into the first record of this kind in the index."""

    def change(data: bytearray) -> None:
        at = next(at for at, kind in _index(bytes(data)) if kind == opcode) + offset
        data[at : at + len(content)] = content

    return change


def _index(data: bytes) -> Iterator[tuple[int, int]]:
    at, _, _ = FOOTER.unpack_from(data, len(data) - 8 - FOOTER.size)
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield at, opcode
        at += 9 + length


def _data_checksum(data: bytearray) -> None:
    end = next(each.begin for each in stretches(bytes(data)) if each.opcode == DATA_END)
    struct.pack_into("<I", data, end + 9, 1)


def _index_checksum(data: bytearray) -> None:
    data[-12] ^= 1


def _log(words: str, spoil: Callable[[], object], command: str = GRIDS) -> Bad:
    return Bad(words, command, spoil=spoil)


def _replace(old: bytes, new: bytes, count: int = 1) -> Callable[[bytearray], None]:
    def change(data: bytearray) -> None:
        assert old in data
        data[:] = data.replace(old, new, count)

    return change


def _short_matrix(topic: str, data: bytes) -> bytes:
    if topic != logs.CALIBRATION:
        return data
    message = CameraCalibration.FromString(data)
    del message.K[4:]
    return message.SerializeToString()


SCENE = {"name": "again"}
NO_INDEX = {"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False}
NO_SUMMARY = {**NO_INDEX, "repeat_channels": False, "repeat_schemas": False}
HUGE = struct.pack("<Q", 1 << 40)
KIND = Kind(
    "Logs: container",
    f"What is wrong with the records of a log `{LOG}`, for `{GRIDS}` or the command that is named.",
    logs.whole,
    (
        _log("no summary", lambda: _written(lambda writer: None, **NO_SUMMARY)),
        _log("a summary without index", lambda: _written(lambda writer: None, **NO_INDEX)),
        _log("the index begins in the data", lambda: _patched(_footer(100), seal_index=False)),
        _log("the index begins beyond the file", lambda: _patched(_footer(1 << 40), seal_index=False)),
        _log("a wrong checksum of the index", lambda: _patched(_index_checksum, seal_index=False)),
        _log("a chunk packed by an unknown method", lambda: _patched(_replace(b"zstd", b"zztd", -1))),
        _log("a chunk of a terabyte", lambda: _patched(_at_chunk(25, HUGE))),
        _log("a chunk of one byte", lambda: _patched(_at_chunk(25, struct.pack("<Q", 1)))),
        _log("a wrong checksum of a chunk", lambda: _patched(_at_chunk(33, b"\1\2\3\4"))),
        _log("the index points beyond the file", lambda: _patched(_in_index(8, 25, HUGE))),
        _log("the index points into a chunk", lambda: _patched(_in_index(8, 25, struct.pack("<Q", 100)))),
        _log(
            "another number of messages in the index", lambda: _patched(_in_index(11, 9, struct.pack("<Q", 3))), CHECK
        ),
        _log("a wrong checksum of all data", lambda: _patched(_data_checksum), CHECK),
        _log("an attachment that was changed", lambda: _patched(_replace(b'{"a": 1}', b'{"a": 2}')), CHECK),
        _log(
            "two attachments of one name",
            lambda: _written(lambda writer: writer.add_attachment(0, 0, "notes.bin", "", b"x")),
            CHECK,
        ),
        _log("two records of a scene", lambda: _written(lambda writer: writer.add_metadata("semgrid.scene", SCENE))),
        _log(
            "a condition that is not a number",
            lambda: _written(lambda writer: writer.add_metadata(CONDITIONS_RECORD, {"noise": "much px"})),
            CHECK,
        ),
        _log("a camera matrix of four numbers", lambda: logs.again(_short_matrix)),
    ),
)
