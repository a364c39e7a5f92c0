import os
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from support.driving import driving

from semgrid_eval.errors import LogError
from semgrid_eval.log.container import Container
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "log.mcap"
    write_log(driving(frames=2, size=(16, 8)), path)
    return path.read_bytes()


def everything(path):
    """All that the reader gives."""
    with LogReader(path) as log:
        frames = list(log.frames("front", images=True))
        return log.scene, log.calibration("front"), log.motion(), log.poses(), list(log.actors()), frames


def everything_of(path, data):
    path.write_bytes(data)
    return everything(path)


def outcome(path: Path, data: bytes) -> object:
    path.write_bytes(data)
    try:
        return everything(path)
    except LogError as error:
        message = str(error)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return LogError


@pytest.mark.parametrize("seed", range(4))
def test_flipped_bits_give_the_same_data_or_an_error_of_ours(whole, tmp_path, seed):
    chance = random.Random(seed)
    path = tmp_path / "log.mcap"
    expected = everything_of(path, whole)
    for _ in range(250):
        data = bytearray(whole)
        for _ in range(chance.choice((1, 1, 2, 8))):
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        assert outcome(path, bytes(data)) in (expected, LogError)


@pytest.mark.parametrize("seed", range(2))
def test_overwritten_stretches_give_the_same_data_or_an_error_of_ours(whole, tmp_path, seed):
    chance = random.Random(seed)
    path = tmp_path / "log.mcap"
    expected = everything_of(path, whole)
    for _ in range(150):
        start, length = chance.randrange(len(whole)), chance.choice((1, 4, 8, 64))
        filling = chance.choice((b"\x00", b"\xff", chance.randbytes(1))) * length
        data = (whole[:start] + filling + whole[start + length :])[: len(whole)]
        assert outcome(path, data) in (expected, LogError)


def test_every_cut_is_an_error(whole, tmp_path):
    for length in [*range(0, len(whole), 97), len(whole) - 1]:
        assert outcome(tmp_path / "log.mcap", whole[:length]) is LogError


@given(st.binary(max_size=200))
@settings(max_examples=50)
def test_any_other_file_is_an_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("any") / "log.mcap"
    assert outcome(path, data) is LogError
    assert outcome(path, b"\x89MCAP0\r\n" + data + b"\x89MCAP0\r\n") is LogError


def test_any_flipped_bit_fails_the_check_of_the_whole_file(whole, tmp_path):
    chance = random.Random(0)
    path = tmp_path / "log.mcap"
    for _ in range(400):
        data = bytearray(whole)
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        path.write_bytes(data)
        with pytest.raises(LogError), LogReader(path) as log:
            log.verify()


def test_missing_file_and_folder_are_named(tmp_path):
    with pytest.raises(LogError, match=r"log\.mcap: cannot be read: No such file"):
        LogReader(tmp_path / "log.mcap")
    with pytest.raises(LogError, match="is not a regular file"):
        LogReader(tmp_path)


def foreign(path, messages, **options):
    """Write messages (topic, time, data) as some other program would."""
    options = {"chunk_size": 64, **options}
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start()
        schema = writer.register_schema("any", "protobuf", b"")
        channels = {}
        for topic, time, data in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "protobuf", schema)
            writer.add_message(channels[topic], log_time=time, publish_time=time, data=data)
        writer.finish()


def read(path, topics=None):
    container = Container(path)
    try:
        return [(entry.log_ns, entry.data) for entry in container.messages(topics)]
    finally:
        container.close()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_messages_of_overlapping_chunks_come_in_the_order_of_time(tmp_path, compression):
    chance = random.Random(5)
    messages = [(f"/{chance.choice('ab')}", chance.randrange(60), bytes([n])) for n in range(120)]
    foreign(tmp_path / "log.mcap", messages, compression=compression)
    expected = sorted(((time, data) for _, time, data in messages), key=lambda entry: entry[0])
    found = read(tmp_path / "log.mcap")
    assert [time for time, _ in found] == [time for time, _ in expected]
    assert sorted(found) == sorted(expected)


def test_messages_of_equal_time_keep_the_order_of_the_file(tmp_path):
    messages = [("/a", 7, bytes([n])) for n in range(50)]
    foreign(tmp_path / "log.mcap", messages)
    assert read(tmp_path / "log.mcap") == [(7, data) for _, _, data in messages]


def test_other_topics_are_left_out(tmp_path):
    foreign(tmp_path / "log.mcap", [("/a", 1, b"a"), ("/b", 2, b"b"), ("/a", 3, b"c")])
    assert read(tmp_path / "log.mcap", ["/a", "/none"]) == [(1, b"a"), (3, b"c")]


def test_file_without_index_is_refused(tmp_path):
    foreign(tmp_path / "log.mcap", [("/a", 1, b"a")], index_types=IndexType.NONE)
    with pytest.raises(LogError, match="its index is incomplete"):
        Container(tmp_path / "log.mcap")


def test_log_of_another_program_is_refused(tmp_path):
    foreign(tmp_path / "log.mcap", [("/a", 1, b"a")])
    with pytest.raises(LogError, match=r"has no metadata record semgrid\.scene"):
        LogReader(tmp_path / "log.mcap")


def test_file_without_checksum_of_its_data_is_digested_as_a_whole(tmp_path):
    digests = set()
    for data in (b"a", b"b"):
        foreign(tmp_path / "log.mcap", [("/a", 1, data)], enable_data_crcs=False)
        container = Container(tmp_path / "log.mcap")
        assert not container.has_checksums
        container.verify()
        digests.add(container.digest)
        container.close()
    assert len(digests) == 2


def test_times_that_no_clock_has_are_refused_before_anything_is_read(tmp_path):
    foreign(tmp_path / "log.mcap", [("/a", 2**63 - 1, b"a")])
    assert read(tmp_path / "log.mcap") == [(2**63 - 1, b"a")]
    for late_ns in (2**63, 2**64 - 1):
        foreign(tmp_path / "log.mcap", [("/a", late_ns, b"a")])
        with pytest.raises(LogError, match=r"times of 2\^63 ns or more"):
            Container(tmp_path / "log.mcap")


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path, make):
    make(tmp_path / "log.mcap")
    with pytest.raises(LogError, match="is not a regular file"):
        Container(tmp_path / "log.mcap")
