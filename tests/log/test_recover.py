import os
import random

import pytest
from mcap.writer import CompressionType, IndexType, Writer
from support.damage import ATTACHMENT, CHUNK, METADATA, flipped, messages, stretches, untouched, zeroed
from support.driving import CALIBRATION, FRAME_NS, START_NS, driving

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.log.check import check_log
from semgrid_eval.log.container import Container
from semgrid_eval.log.convert import convert_recordings
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.recover import recover_log
from semgrid_eval.log.store import write_log

FRONT = "/camera/front"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "log.mcap"
    write_log(driving(frames=6, size=(16, 8)), path)
    return path.read_bytes()


@pytest.fixture
def recover(tmp_path):
    """Recovers bytes, and makes sure that nothing is saved but what the original held."""

    def recovered(data):
        (tmp_path / "log.mcap").write_bytes(data)
        return recover_log(tmp_path / "log.mcap", tmp_path / "out" / "log.mcap")

    return recovered


def saved(recovery):
    """Messages of the new log, without their channels, sorted."""
    found = [message[1:] for held in messages(recovery.out.read_bytes()).values() for message in held]
    return sorted(found)


def of(whole_messages):
    return sorted(message[1:] for message in whole_messages)


def everything(data):
    return of(message for held in messages(data).values() for message in held)


def chunks(data):
    return [each for each in stretches(data) if each.opcode == CHUNK]


def lost_lines(recovery):
    return [str(loss).partition(": ")[2] for loss in recovery.losses]


def test_a_whole_log_is_copied_byte_by_byte(whole, recover):
    found = recover(whole)
    assert found.is_whole
    assert found.lost_nothing
    assert found.out.read_bytes() == whole
    assert found.lost == {}


def test_of_a_damaged_chunk_all_else_is_saved_and_its_messages_are_named(whole, recover):
    label, image = chunks(whole)[4:6]  # of the fourth frame, which has a colour image
    found = recover(flipped(whole, image.begin + 100))
    assert saved(found) == of(untouched(whole, flipped(whole, image.begin + 100)))
    assert found.lost == {f"{FRONT}/image": 1}
    stamp_ns = START_NS + 3 * FRAME_NS
    assert lost_lines(found) == [f"a chunk does not match its checksum: 1 of {FRONT}/image (at {stamp_ns} ns)"]
    assert found.total[f"{FRONT}/image"] == 2
    report = check_log(found.out)
    assert report.good
    assert label.end <= image.begin


def test_without_index_the_message_indexes_tell_what_a_chunk_held(whole, recover):
    image = chunks(whole)[5]
    end = stretches(whole)[-1].begin
    found = recover(flipped(whole, image.begin + 100)[:end])
    assert found.total is None
    assert [each.count for loss in found.losses[:1] for each in loss.messages] == [1]
    assert found.losses[-1].messages is None
    assert found.losses[-1].reason == "the end of the file is missing"
    assert found.losses[-1].saved_before_ns == START_NS + 5 * FRAME_NS
    assert found.lost is None
    assert "lost: how many messages is not known" in list(found.lines())


def test_only_the_index_is_lost(whole, recover):
    data = flipped(whole, len(whole) - 60)
    found = recover(data)
    assert saved(found) == everything(whole)
    assert found.lost_nothing
    assert found.lost == {}
    assert check_log(found.out).good


@pytest.mark.parametrize("place", range(4))
def test_a_cut_log_gives_all_chunks_before_the_cut(whole, recover, place):
    cut = chunks(whole)[place + 1].begin + 50
    found = recover(whole[:cut])
    expected = [message for begin, held in messages(whole).items() if begin < cut - 50 for message in held]
    assert saved(found) == of(expected)
    assert found.lost is None
    with LogReader(found.out) as log:
        assert log.scene.name == "street"
        assert log.attachments() == driving().source_files
        assert log.calibration("front") == CALIBRATION


def test_zeros_over_two_chunks_and_their_headers_cost_those_two(whole, recover):
    first, second = chunks(whole)[2:4]
    data = zeroed(whole, first.begin - 5, second.end - 5)
    found = recover(data)
    assert saved(found) == of(untouched(whole, data))
    assert sum(found.lost.values()) == len(everything(whole)) - len(saved(found))
    told = [each for loss in found.losses for each in loss.messages]  # their message indexes are lost with them
    assert sum(each.count for each in told) == len(everything(whole)) - len(saved(found))
    assert {each.topic for each in told} == found.lost.keys()
    found = recover(data[:-40])  # without index
    assert saved(found) == of(untouched(whole, data))


def test_the_channels_that_the_first_chunk_defines_survive_it_in_the_index(whole, recover):
    data = flipped(whole, chunks(whole)[0].begin + 100)
    found = recover(data)
    assert saved(found) == of(untouched(whole, data))
    assert check_log(found.out).good
    with pytest.raises(LogError, match="holds no message that can be saved"):
        recover(data[:-40])  # who wrote what is in neither place


def test_messages_of_channels_that_nothing_defines_are_lost_and_counted(tmp_path, recover):
    path = tmp_path / "two.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=64)
        writer.start()
        for topic in ("/a", "/b"):
            channel = writer.register_channel(topic, "any", 0)
            for time in (1, 2):
                writer.add_message(channel, time, bytes(60), time)
        for first, time in ((1, 3), (2, 4)):
            writer.add_message(first, time, bytes(60), time)
        writer.finish()
    data = path.read_bytes()
    found = recover(flipped(data, chunks(data)[0].begin + 60)[:-40])
    assert found.saved == {"/b": 3}
    told = [message for loss in found.losses for message in loss.messages or ()]
    assert [(each.topic, each.count) for each in told if "not known" in each.topic] == [
        ("channel 1, whose topic is not known", 1),
    ] * 3


@pytest.mark.parametrize("opcode", [ATTACHMENT, METADATA])
def test_a_damaged_attachment_or_scene_is_left_out_and_named(whole, recover, opcode):
    record = next(each for each in stretches(whole) if each.opcode == opcode)
    found = recover(flipped(whole, record.end - 8))
    assert saved(found) == everything(whole)
    name = {ATTACHMENT: "attachment front_camera.json", METADATA: "metadata semgrid.scene"}[opcode]
    assert found.lost_files == (name,)
    assert f"lost: {name}" in list(found.lines())


def foreign(path, *, data_crc=False, **options):
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=64, enable_data_crcs=data_crc, **options)
        writer.start()
        writer.add_metadata("note", {"a": "b"})
        channel = writer.register_channel("/a", "any", writer.register_schema("any", "protobuf", b"xyz"))
        for time in range(6):
            writer.add_message(channel, time, bytes([time]) * 60, 100 + time, sequence=time)
        writer.finish()
    return path.read_bytes()


@pytest.mark.parametrize("compression", list(CompressionType))
def test_times_sequence_and_bytes_stay_whatever_the_compression(tmp_path, recover, compression):
    data = foreign(tmp_path / "other.mcap", compression=compression)
    damaged = flipped(data, chunks(data)[2].end - 20)
    found = recover(damaged)
    assert saved(found) == of(untouched(data, damaged))
    assert found.saved == {"/a": 5}
    assert found.unproved == ("metadata note: 1",)
    assert found.total == {"/a": 6}


def test_a_chunk_without_checksum_is_not_believed(tmp_path, recover):
    data = foreign(tmp_path / "other.mcap", compression=CompressionType.NONE)
    second = chunks(data)[1]
    damaged = zeroed(data, second.begin + 9 + 24, second.begin + 9 + 28)
    damaged = flipped(damaged, second.end - 3)
    for given in (damaged, damaged[:-30]):
        found = recover(given)
        assert saved(found) == of(untouched(data, damaged))
        assert "has no checksum" in found.losses[0].reason


def test_messages_outside_chunks_are_kept_and_said_to_be_unproved(tmp_path, recover):
    data = foreign(tmp_path / "other.mcap", use_chunking=False)
    found = recover(data)
    assert found.saved == {"/a": 6}
    assert found.unproved == ("messages outside chunks: 6", "metadata note: 1")
    with Container(found.out) as log:
        assert [entry.data[0] for entry in log.messages()] == list(range(6))
    proved = recover(foreign(tmp_path / "other.mcap", use_chunking=False, data_crc=True, index_types=IndexType.NONE))
    assert proved.saved == {"/a": 6}
    assert proved.unproved == ()


def test_a_record_that_a_flip_makes_a_message_is_none(whole, recover):
    index = next(each for each in stretches(whole) if each.opcode == 7)
    damaged = whole[: index.begin] + b"\x05" + whole[index.begin + 1 : -40]
    found = recover(damaged)
    assert saved(found) == everything(whole)
    assert "looks like a message outside chunks" in found.losses[0].reason


def test_the_inside_of_an_uncompressed_chunk_whose_length_is_damaged_is_not_taken_for_records(tmp_path, recover):
    data = foreign(tmp_path / "other.mcap", compression=CompressionType.NONE)
    inner = 9 + 40  # up to the first record of a chunk
    for each in chunks(data)[1:]:
        damaged = data[: each.begin + 1] + (inner - 9).to_bytes(8, "little") + data[each.begin + 9 :]
        for given in (damaged, damaged[:-30]):
            found = recover(given)
            assert saved(found) == of(untouched(data, damaged))


def test_a_recovered_log_says_so_and_is_converted_again(tmp_path):
    convert_recordings([driving()], tmp_path)
    path = tmp_path / "val" / "street.mcap"
    data = path.read_bytes()
    lost = len(messages(data)[chunks(data)[3].begin])
    path.write_bytes(flipped(data, chunks(data)[3].begin + 90))
    recover_log(path, tmp_path / "out.mcap")
    (first,) = [finding for finding in check_log(tmp_path / "out.mcap").findings if finding.place == "file"]
    assert f"was recovered from a damaged log, which lost {lost} messages" in first.message
    path.write_bytes((tmp_path / "out.mcap").read_bytes())
    assert convert_recordings([driving()], tmp_path).written == ["val/street"]
    assert path.read_bytes() == data


def test_losses_of_two_recoveries_add_up(whole, recover):
    first = recover(flipped(whole, chunks(whole)[5].begin + 100)).out.read_bytes()
    second = recover(flipped(first, chunks(first)[0].begin + 100))
    with LogReader(second.out) as log:
        assert log.recovered().lost_messages == 1 + sum(second.lost.values())


@pytest.mark.parametrize("data", [b"", b"no log", bytes(3000), b"\x89MCAP0\r\n" * 2])
def test_what_is_no_log_is_one_error_and_leaves_nothing(recover, tmp_path, data):
    with pytest.raises(LogError, match=r"log\.mcap: holds no message that can be saved"):
        recover(data)
    assert not list((tmp_path / "out").iterdir())


def test_the_holes_of_a_sparse_file_are_not_read(whole, recover, tmp_path):
    path = tmp_path / "log.mcap"
    path.write_bytes(whole[: stretches(whole)[-1].begin])  # up to the end of its data
    os.truncate(path, 1 << 40)
    with path.open("r+b") as stream:
        stream.seek((1 << 40) - (1 << 20))
        stream.write(whole[chunks(whole)[2].begin :])
    found = recover_log(path, tmp_path / "out.mcap")
    again = [message for begin, held in messages(whole).items() if begin >= chunks(whole)[2].begin for message in held]
    assert saved(found) == sorted(everything(whole) + of(again))


def test_a_log_that_cannot_be_written_is_named(whole, tmp_path):
    (tmp_path / "log.mcap").write_bytes(whole[:-30])
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file/log\.mcap: cannot be written"):
        recover_log(tmp_path / "log.mcap", tmp_path / "file" / "log.mcap")


@pytest.mark.parametrize("seed", range(3))
def test_whatever_is_damaged_every_untouched_message_is_saved_and_no_other(whole, recover, seed):
    chance = random.Random(seed)
    for _ in range(40):
        data = whole
        for _ in range(chance.choice((1, 1, 2, 4))):
            at = chance.randrange(len(data))
            data = (
                flipped(data, at)
                if chance.random() < 0.6
                else zeroed(data, at, min(at + chance.randrange(1, 3000), len(data)))
            )
        expected = of(untouched(whole, data))
        try:
            found = recover(data)
        except LogError:
            continue
        assert set(saved(found)) <= set(everything(whole))
        unknown = sum(
            message.count
            for loss in found.losses
            for message in loss.messages or ()
            if loss.reason.startswith("the topic")
        )
        assert len(saved(found)) >= len(expected) - unknown
        with Container(found.out) as log:
            log.verify()
            assert sum(1 for _ in log.messages()) == log.message_count
