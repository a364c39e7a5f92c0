"""Save what is whole in a damaged log to a new one, and say what was lost."""

import io
import shutil
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import atomic_file, open_regular
from semgrid_eval.log import codec, recovered
from semgrid_eval.log.container import Container, damage_as_log_error
from semgrid_eval.log.copying import Copier, Definitions
from semgrid_eval.log.losses import Contents, Loss, lost_messages
from semgrid_eval.log.records import Index, data_crc, read_attachment, read_chunk, read_metadata, unpack_chunk
from semgrid_eval.log.recovered import Recovered
from semgrid_eval.log.recovery import Recovery
from semgrid_eval.log.salvage import Hole, Part, body_of, surviving_index, walk

Steps = Sequence[Part | Hole]


def recover_log(path: Path, out: Path) -> Recovery:
    """Write a log `out` of all records of a log that are whole; nothing is copied from a chunk whose checksum fails.

    Raises:
        LogError: the log cannot be read, or holds no message that can be saved.
        InputError: the new log cannot be written.
    """
    saved = _saved_if_whole(path)
    with _opened(path) as stream, damage_as_log_error(path), atomic_file(out) as target:
        if saved is not None:
            shutil.copyfileobj(stream, target)
            return Recovery(path, out, is_whole=True, saved=saved, total=saved)
        return _Recovery(path, out, stream).write(target)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        stream = open_regular(path, limit=sys.maxsize)
    except InputError as error:
        raise LogError(str(error).removeprefix(f"{path}: "), path=path) from error
    with stream:
        yield stream


def _saved_if_whole(path: Path) -> dict[str, int] | None:
    """Count the messages of a log by topic; None where it is damaged or has no checksums to tell."""
    try:
        with Container(path) as log:
            log.verify()
            log.attachments()
            counts = Counter(entry.topic for entry in log.messages())
            whole = log.has_checksums and counts.total() == log.message_count
    except LogError:
        return None
    return dict(counts) if whole else None


class _Recovery:
    def __init__(self, path: Path, out: Path, stream: BinaryIO) -> None:
        self._path, self._out, self._stream = path, out, stream
        self._index = surviving_index(stream)
        self._steps: Steps = list(walk(stream, self._index))
        self._is_proved = _data_hold(stream, self._steps)
        if self._is_proved:
            self._steps = list(walk(stream, self._index, proved=True))
        self._has_chunks = any(step.opcode == Opcode.CHUNK for step in self._steps)
        self._contents = Contents(stream, self._steps, self._index)
        self._losses: list[Loss] = []
        self._lost_files: list[str] = _lost_files(self._steps, self._index)
        self._bare: Counter[str] = Counter()
        self._last_ns: int | None = None
        self._earlier = Recovered()

    def write(self, target: BinaryIO) -> Recovery:
        self._copier = Copier(target, self._definitions())
        for step in self._steps:
            if isinstance(step, Hole):
                held = self._contents.of(step, self._copier.topics)
                self._losses.append(Loss(step.begin, step.end, step.reason, held, self._last_ns))
            elif step.opcode in _COPIED:
                _COPIED[step.opcode](self, step)
        self._losses += self._cut()
        if not self._copier.saved:
            raise LogError("holds no message that can be saved", path=self._path)
        found = self._found()
        lost = None if found.lost is None else sum(found.lost.values())
        note = Recovered(lost, ", ".join(found.unproved)).after(self._earlier)
        self._copier.metadata(recovered.RECORD, note.to_metadata())
        self._copier.finish()
        return found

    def _found(self) -> Recovery:
        statistics = self._index and self._index.summary.statistics
        total: Counter[str] | None = None
        if statistics:
            total = Counter()
            for channel, count in statistics.channel_message_counts.items():
                total[self._copier.topics.get(channel, f"channel {channel}")] += count
        names = tuple(f"{what}: {count}" for what, count in sorted(self._bare.items()))
        files = tuple(self._lost_files)
        saved = dict(sorted(self._copier.saved.items()))
        return Recovery(self._path, self._out, False, saved, total, tuple(self._losses), files, names)

    def _definitions(self) -> Definitions:
        """Gather schemas and channels: those that checksums prove, then those outside chunks that nothing proves."""
        found = Definitions()
        if self._index is not None:
            found.add([*self._index.summary.schemas.values(), *self._index.summary.channels.values()])
        else:
            for part in _parts(self._steps, Opcode.CHUNK):
                found.add(unpack_chunk(read_chunk(body_of(self._stream, part))))
        bare = [*_parts(self._steps, Opcode.SCHEMA), *_parts(self._steps, Opcode.CHANNEL)]
        found.add(_definition(part.opcode, body_of(self._stream, part)) for part in bare)
        return found

    def _chunk(self, part: Part) -> None:
        unknown: dict[int, list[int]] = defaultdict(list)
        held = unpack_chunk(read_chunk(body_of(self._stream, part)))
        self._copier.define(held)
        messages = [record for record in held if isinstance(record, records.Message)]
        for message in messages:
            if not self._copier.message(message):
                unknown[message.channel_id].append(message.log_time)
        self._copier.end_chunk()
        self._saved_times([message.log_time for message in messages])
        if unknown:
            reason = "the topics of channels are lost"
            self._losses.append(Loss(part.begin, part.end, reason, lost_messages(unknown, {}), self._last_ns))

    def _message(self, part: Part) -> None:
        body = body_of(self._stream, part)
        message = records.Message.read(ReadDataStream(io.BytesIO(body)), len(body))
        held = None
        if self._has_chunks and not self._is_proved:  # any record becomes one by a flip in its opcode
            reason = "something that looks like a message outside chunks, in a log of chunks"
        elif self._copier.message(message):
            reason = ""
            self._saved_times([message.log_time])
            self._unproved("messages outside chunks")
        else:
            reason, held = "the topic of a channel is lost", lost_messages({message.channel_id: [message.log_time]}, {})
        if reason:
            self._losses.append(Loss(part.begin, part.end, reason, held, self._last_ns))

    def _attachment(self, part: Part) -> None:
        self._copier.attachment(read_attachment(body_of(self._stream, part)))

    def _metadata(self, part: Part) -> None:
        record = read_metadata(body_of(self._stream, part))
        if record.name == recovered.RECORD:
            self._earlier = Recovered.from_metadata(record.metadata).after(self._earlier)
        elif record.name == codec.RECORD and not codec.is_scene_whole(record.metadata):
            self._lost_files.append(f"metadata {record.name}")
        else:
            if record.name != codec.RECORD:
                self._unproved(f"metadata {record.name}")
            self._copier.metadata(record.name, record.metadata)

    def _unproved(self, what: str) -> None:
        if not self._is_proved:
            self._bare[what] += 1

    def _saved_times(self, times_ns: Sequence[int]) -> None:
        """Note when messages of a whole record were, and so when those of the stretches before it end."""
        if not times_ns:
            return
        for place in range(len(self._losses) - 1, -1, -1):
            if self._losses[place].saved_after_ns is not None:
                break
            self._losses[place] = replace(self._losses[place], saved_after_ns=min(times_ns))
        self._last_ns = max(times_ns)

    def _cut(self) -> Iterator[Loss]:
        """Say that the end is missing where nothing else says so."""
        last = self._steps[-1] if self._steps else None
        if self._index is None and isinstance(last, Part) and last.opcode not in (Opcode.DATA_END, Opcode.FOOTER):
            yield Loss(last.end, last.end, "the end of the file is missing", None, self._last_ns)


_COPIED: dict[int, Callable[[_Recovery, Part], None]] = {
    Opcode.CHUNK: _Recovery._chunk,
    Opcode.MESSAGE: _Recovery._message,
    Opcode.ATTACHMENT: _Recovery._attachment,
    Opcode.METADATA: _Recovery._metadata,
}


def _parts(steps: Steps, opcode: int) -> Iterator[Part]:
    return (step for step in steps if isinstance(step, Part) and step.opcode == opcode)


def _definition(opcode: int, body: bytes) -> records.McapRecord:
    kind = records.Schema if opcode == Opcode.SCHEMA else records.Channel
    found: records.McapRecord = kind.read(ReadDataStream(io.BytesIO(body)))
    return found


def _data_hold(stream: BinaryIO, steps: Steps) -> bool:
    """Tell whether there is a checksum of all data, and it holds; it cannot where the way through them was lost."""
    if any(isinstance(step, Hole) and step.opcode is None for step in steps):
        return False
    for part in _parts(steps[-1:], Opcode.DATA_END):
        expected = records.DataEnd.read(ReadDataStream(io.BytesIO(body_of(stream, part)))).data_section_crc
        return bool(expected) and data_crc(stream, part.begin) == expected
    return False


def _lost_files(steps: Steps, index: Index | None) -> list[str]:
    """Name the attachments and metadata records that are not whole."""
    if index is None:
        lost = [step for step in steps if isinstance(step, Hole)]
        names = {Opcode.ATTACHMENT: "an attachment, its name unknown", Opcode.METADATA: "a metadata record"}
        return [names[Opcode(hole.opcode)] for hole in lost if hole.opcode in names]
    there = {(part.opcode, part.begin) for part in steps if isinstance(part, Part)}
    listed = [(Opcode.ATTACHMENT, "attachment", each.offset, each.name) for each in index.summary.attachment_indexes]
    listed += [(Opcode.METADATA, "metadata", each.offset, each.name) for each in index.summary.metadata_indexes]
    return [f"{what} {name}" for opcode, what, offset, name in listed if (opcode, offset) not in there]
