"""What a damaged log has lost: which messages of which topics and times, as far as what is left of it tells."""

import io
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import BinaryIO

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from semgrid_eval.log.records import Index
from semgrid_eval.log.salvage import Hole, Part, body_of

_INDEX_BYTES, _ENTRY_BYTES = 15, 16  # of a message index with no message, and more for each
Times = Sequence[int]
"""Times of messages (ns)."""


@dataclass(frozen=True)
class LostMessages:
    """Messages of one topic that were lost from a stretch; None is not known, and times are then those around it."""

    topic: str
    count: int | None
    first_ns: int | None
    last_ns: int | None

    def __str__(self) -> str:
        many = "an unknown number" if self.count is None else str(self.count)
        if self.first_ns is None:
            return f"{many} of {self.topic}"
        when = f"at {self.first_ns} ns" if self.first_ns == self.last_ns else f"{self.first_ns} to {self.last_ns} ns"
        return f"{many} of {self.topic} ({when})"


@dataclass(frozen=True)
class Loss:
    """A stretch of a file that was not saved.

    `messages` is None where nothing tells what it held; its messages are then between the times that were saved before
    it and after it, where the log was written in the order of time.
    """

    begin: int  # byte
    end: int
    reason: str
    messages: tuple[LostMessages, ...] | None
    saved_before_ns: int | None = None
    saved_after_ns: int | None = None

    def __str__(self) -> str:
        return f"bytes {self.begin} to {self.end}: {self.reason}: {self._held()}"

    def _held(self) -> str:
        if self.messages is not None:
            return "; ".join(map(str, self.messages)) or "no message"
        ends = [
            f"{words} {time_ns} ns"
            for words, time_ns in (("after", self.saved_before_ns), ("before", self.saved_after_ns))
            if time_ns is not None
        ]
        return f"what it held is not known{', ' if ends else ''}{' and '.join(ends)}"


class Contents:
    """What lost stretches held, by the message indexes that followed their chunks and by the index of the file."""

    def __init__(self, stream: BinaryIO, steps: Sequence[Part | Hole], index: Index | None) -> None:
        self._stream, self._steps = stream, steps
        self._places = {step.begin: place for place, step in enumerate(steps)}
        self._chunks = None if index is None else index.summary.chunk_indexes
        self._has_bare = not self._chunks or any(_is_part(step, Opcode.MESSAGE) for step in steps)

    def of(self, hole: Hole, topics: Mapping[int, str]) -> tuple[LostMessages, ...] | None:
        """Return what a stretch held, by topics in order; None where nothing tells."""
        if self._chunks is not None and not (self._has_bare and hole.opcode is None):
            lost = [each for each in self._chunks if hole.begin <= each.chunk_start_offset < hole.end]
            return _joined(message for each in lost for message in self._indexed(each, topics))
        if hole.opcode != Opcode.CHUNK:
            return None
        found = list(self._message_indexes_after(hole))
        return _joined(_lost(topics, *self._message_index(part)) for part in found) if found else None

    def _message_indexes_after(self, hole: Hole) -> Iterator[Part]:
        for place in range(self._places[hole.begin] + 1, len(self._steps)):
            step = self._steps[place]
            if not isinstance(step, Part) or step.opcode != Opcode.MESSAGE_INDEX:
                return
            yield step

    def _indexed(self, chunk: records.ChunkIndex, topics: Mapping[int, str]) -> Iterator[LostMessages]:
        """Say what a chunk held: by its message indexes, or by how long the index of the file says that they are."""
        times_ns = chunk.message_start_time, chunk.message_end_time
        for channel, offset, size in _places_of_indexes(chunk):
            step = self._steps[self._places[offset]] if offset in self._places else None
            if isinstance(step, Part) and step.opcode == Opcode.MESSAGE_INDEX:
                yield _lost(topics, *self._message_index(step))
            else:
                count, rest = divmod(size - _INDEX_BYTES, _ENTRY_BYTES)
                yield LostMessages(_topic(topics, channel), None if rest else count, *times_ns)

    def _message_index(self, part: Part) -> tuple[int, Times]:
        found = records.MessageIndex.read(ReadDataStream(io.BytesIO(body_of(self._stream, part))))
        return found.channel_id, [time_ns for time_ns, _ in found.records]


def _places_of_indexes(chunk: records.ChunkIndex) -> Iterator[tuple[int, int, int]]:
    """Iterate over the channels of a chunk, where their message indexes begin, and how many bytes they have."""
    places = sorted((offset, channel) for channel, offset in chunk.message_index_offsets.items())
    end = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length
    ends = [*(offset for offset, _ in places[1:]), end]
    return ((channel, offset, after - offset) for (offset, channel), after in zip(places, ends, strict=True))


def lost_messages(times_ns: Mapping[int, Times], topics: Mapping[int, str]) -> tuple[LostMessages, ...]:
    """Say that messages of these channels were lost, at these times."""
    return _joined(_lost(topics, channel, times) for channel, times in times_ns.items())


def _is_part(step: Part | Hole, opcode: int) -> bool:
    return isinstance(step, Part) and step.opcode == opcode


def _topic(topics: Mapping[int, str], channel: int) -> str:
    return topics.get(channel, f"channel {channel}, whose topic is not known")


def _lost(topics: Mapping[int, str], channel: int, times_ns: Times) -> LostMessages:
    first_ns, last_ns = (min(times_ns), max(times_ns)) if times_ns else (None, None)
    return LostMessages(_topic(topics, channel), len(times_ns), first_ns, last_ns)


def _joined(messages: Iterable[LostMessages]) -> tuple[LostMessages, ...]:
    """Join what is said of one topic."""
    by_topic: dict[str, list[LostMessages]] = defaultdict(list)
    for message in messages:
        by_topic[message.topic].append(message)
    return tuple(_sum(topic, found) for topic, found in sorted(by_topic.items()))


def _sum(topic: str, found: Sequence[LostMessages]) -> LostMessages:
    counts = [each.count for each in found]
    count = None if None in counts else sum(each for each in counts if each is not None)
    firsts = [each.first_ns for each in found if each.first_ns is not None]
    lasts = [each.last_ns for each in found if each.last_ns is not None]
    return LostMessages(topic, count, min(firsts, default=None), max(lasts, default=None))
