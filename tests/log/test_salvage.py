import io
from collections import Counter

import pytest
from support.damage import CHUNK, flipped, stretches
from support.driving import driving

from semgrid_eval.log.salvage import Hole, walk
from semgrid_eval.log.store import write_log


class CountingStream(io.BytesIO):
    """Counts how often each stretch of bytes is read."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.reads: Counter[tuple[int, int]] = Counter()

    def read(self, size: int | None = -1) -> bytes:
        begin = self.tell()
        found = super().read(size)
        self.reads[begin, len(found)] += 1
        return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "log.mcap"
    write_log(driving(frames=6, size=(16, 8)), path)
    return path.read_bytes()


def test_a_damaged_chunk_of_its_size_is_read_once_and_ends_where_it_says(whole):
    chunk = [each for each in stretches(whole) if each.opcode == CHUNK][3]
    stream = CountingStream(flipped(whole, chunk.end - 20))
    (hole,) = (step for step in walk(stream, None) if isinstance(step, Hole))
    assert (hole.begin, hole.end, hole.opcode) == (chunk.begin, chunk.end, CHUNK)
    inside = [times for (begin, _), times in stream.reads.items() if chunk.begin + 9 <= begin < chunk.end]
    assert inside == [1]
