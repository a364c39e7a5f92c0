"""Sweeps of LiDARs in logs: they come back, hostile ones end in a line, and `check` looks at them."""

from dataclasses import replace

import numpy as np
import pytest
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from google.protobuf.message import DecodeError
from support.driving import driving
from support.swept import START_NS, Drive, recorded, scanned, sweep

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import read_recording, write_log
from semgrid_eval.log.sweeps import read_sweep, sweep_message
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.recording.types import Moment, MotionSample

POINTS = [(1.5, -2.25, 0.125), (40.0, 3.0, -1.7), (0.1, 0.2, 0.3)]


def equal(one, other):
    assert (one.stamp_ns, one.mount) == (other.stamp_ns, other.mount)
    for name in ("points_m", "intensity", "label_id"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert getattr(one, name) is None or getattr(one, name).dtype == getattr(other, name).dtype


@pytest.mark.parametrize("labels", [["car", "road", "person"], None])
def test_a_sweep_comes_back_exactly(labels):
    given = sweep(START_NS, POINTS, labels)
    equal(read_sweep(sweep_message(given).SerializeToString()), given)


def test_points_are_packed_as_the_page_says():
    message = sweep_message(sweep(START_NS, POINTS, ["car", "road", "person"]))
    assert message.frame_id == "base_link"
    assert message.point_stride == 17
    assert [(field.name, field.offset) for field in message.fields] == [
        *(("x", 0), ("y", 4), ("z", 8)),
        *(("intensity", 12), ("label", 16)),
    ]
    assert np.frombuffer(message.data[17:29], "<f4").tolist() == pytest.approx(POINTS[1])
    assert message.data[16] == 26


def test_fields_may_lie_elsewhere_among_others():
    packed = np.zeros(
        2, {"names": ["label", "ring", "intensity", "z", "y", "x"], "formats": ["u1", "<u2", *["<f4"] * 4]}
    )
    packed["x"], packed["label"] = (7.0, 8.0), (7, 8)
    kinds = {"u1": PackedElementField.UINT8, "<u2": PackedElementField.UINT16, "<f4": PackedElementField.FLOAT32}
    fields = [
        PackedElementField(name=name, offset=offset, type=kinds[kind.str.removeprefix("|")])
        for name, (kind, offset) in packed.dtype.fields.items()
    ]
    message = sweep_message(sweep(START_NS, []))
    del message.fields[:]
    message.fields.extend(fields)
    message.point_stride, message.data = packed.dtype.itemsize, packed.tobytes()
    found = read_sweep(message.SerializeToString())
    assert found.points_m.tolist() == [[7.0, 0.0, 0.0], [8.0, 0.0, 0.0]]
    assert found.label_id.tolist() == [7, 8]


def changed(**changes):
    message = sweep_message(sweep(START_NS, POINTS, ["car"] * 3))
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def of_another_type(name):
    message = changed()
    for field in message.fields:
        if field.name == name:
            field.type = PackedElementField.FLOAT64
    return message


def without(name):
    message = changed()
    kept = [field for field in message.fields if field.name != name]
    del message.fields[:]
    message.fields.extend(kept)
    return message


def turned(w):
    message = changed()
    message.pose.orientation.z, message.pose.orientation.w = 0.0, w
    return message


@pytest.mark.parametrize(
    ("message", "line"),
    [
        (changed(frame_id="map"), "a sweep is in frame 'map', not base_link"),
        (changed(point_stride=0), "field x of a sweep has another type or place than it must"),
        (changed(point_stride=18), "a sweep of 51 bytes does not hold points of 18 bytes"),
        (changed(point_stride=1 << 31), "a sweep of 51 bytes does not hold points of 2147483648 bytes"),
        (changed(data=b"\xff" * 17), r"point 0, \(nan, nan, nan\) m, is not within 1000 m of the LiDAR"),
        (changed(data=bytes(17 * ((1 << 22) + 1))), "a sweep has 4194305 points; at most 4194304 are allowed"),
        (without("y"), "a sweep has no field y"),
        (of_another_type("label"), "field label of a sweep has another type or place than it must"),
        (turned(0.0), r"\(0, 0, 0, 0\) is not a rotation"),
    ],
)
def test_a_bad_sweep_ends_in_a_line(message, line):
    with pytest.raises((ValueError, InputError), match=f"^{line}$"):
        read_sweep(message.SerializeToString())


def test_bytes_that_are_no_message_are_damage():
    with pytest.raises(DecodeError):
        read_sweep(b"\xff\xff\xff")


@pytest.fixture
def both(tmp_path):
    """A log with a camera and two LiDARs of other times."""

    def moments():
        for moment in driving().moments():
            yield replace(moment, sweeps={"top": sweep(moment.stamp_ns, POINTS, ["car"] * 3)})
            later_ns = moment.stamp_ns + 1_000_000
            yield Moment(later_ns, {}, sweeps={"rear": sweep(later_ns, POINTS[:1])})

    write_log(replace(driving(), moments=moments), tmp_path / "both.mcap")
    return tmp_path / "both.mcap"


def test_sweeps_of_several_lidars_stand_beside_cameras(both):
    with LogReader(both) as log:
        assert log.lidars == ("rear", "top")
        assert log.scene.cameras == ("front",)
        assert len(list(log.frames("front"))) == 6
        top = list(log.sweeps("top"))
        assert [each.stamp_ns for each in top] == [moment.stamp_ns for moment in driving().moments()]
        equal(top[0], sweep(top[0].stamp_ns, POINTS, ["car"] * 3))
        assert {len(each.points_m) for each in log.sweeps("rear")} == {1}
        with pytest.raises(LogError, match=r"both\.mcap: lidar: there are several, name one: rear, top$"):
            log.choose_lidar(None)


def test_a_log_with_sweeps_read_back_and_written_again_has_the_same_bytes(both, tmp_path):
    write_log(read_recording(both), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == both.read_bytes()


def test_pictures_are_read_without_unpacking_sweeps(both):
    with LogReader(both) as log:
        swept = {number for number, channel in log.summary.channels.items() if "lidar" in channel.topic}
        for chunk in log.summary.chunk_indexes:
            assert not swept & chunk.message_index_offsets.keys() or len(chunk.message_index_offsets) == 1


def test_a_log_without_cameras_is_sound(tmp_path):
    write_log(scanned(Drive(), range(0, 10**9, 10**8), [(20.0, 1.0)]), tmp_path / "log.mcap")
    report = check_log(tmp_path / "log.mcap")
    assert report.findings == ()
    assert report.counts["/lidar/top/points"] == 10


def test_a_log_in_which_nothing_sees_is_not(tmp_path):
    blind = recorded(lambda: iter([Moment(START_NS, {}, (MotionSample(START_NS, 1.0, 0.0),))]))
    write_log(blind, tmp_path / "log.mcap")
    assert "error: sensors: there are 0 (allowed: at least 1)" in [
        str(each) for each in check_log(tmp_path / "log.mcap").findings
    ]


def test_a_damaged_sweep_is_an_error_of_its_file_and_topic(tmp_path):
    whole = scanned(Drive(), (0, 10**8), [(20.0, 1.0)])
    write_log(whole, tmp_path / "log.mcap")
    path = tmp_path / "bad.mcap"
    with LogReader(tmp_path / "log.mcap") as log, path.open("wb") as stream, MessageWriter(stream) as writer:
        writer.metadata("semgrid.scene", log.metadata("semgrid.scene"))
        for topic, stamp_ns, data, _ in log.messages(["/lidar/top/points"]):
            message = PointCloud.FromString(data)
            message.data = b"\x00\x00\xc0\x7f" + message.data[4:]
            writer.write(topic, message, log_ns=stamp_ns)
    with LogReader(path) as log, pytest.raises(LogError) as raised:
        list(log.sweeps("top"))
    told = f"/lidar/top/points at {START_NS} ns: point 0, (nan, "
    assert str(raised.value).startswith(f"{path}: {told}")
    (fault,) = [each for each in check_log(path).findings if each.place == "file"]
    assert told in fault.message
