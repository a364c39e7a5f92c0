from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.driving import FRAME_NS, START_NS, driving

from semgrid_eval.errors import LogError
from semgrid_eval.log import codec
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import read_recording, write_log
from semgrid_eval.recording.types import Pose


def rewritten(recording, path):
    """Write a recording, read it back and write it again."""
    first, second = path / "first.mcap", path / "second.mcap"
    write_log(recording, first)
    write_log(read_recording(first), second)
    return first.read_bytes(), second.read_bytes()


def moments_of(*moments):
    return replace(driving(), moments=lambda: iter(moments))


@pytest.mark.parametrize("cameras", [("front",), ("rear", "front")])
def test_log_read_back_and_written_again_has_the_same_bytes(tmp_path, cameras):
    first, second = rewritten(driving(cameras=cameras), tmp_path)
    assert first == second


def test_moments_come_back_with_all_they_held(tmp_path):
    write_log(driving(), tmp_path / "log.mcap")
    read = read_recording(tmp_path / "log.mcap")
    for now, then in zip(read.moments(), driving().moments(), strict=True):
        assert (now.stamp_ns, now.motion, now.actors) == (then.stamp_ns, then.motion, then.actors)
        assert now.pose.yaw_rad == pytest.approx(then.pose.yaw_rad, abs=1e-14)
        assert now.cameras["front"].image_file == then.cameras["front"].image_file
        assert (now.cameras["front"].label_png is None) == (then.cameras["front"].label_png is None)
    assert read.source_files == driving().source_files
    assert read.calibrations == driving().calibrations
    assert list(read.moments()) == list(read.moments())


@pytest.mark.parametrize("group", ["", "town03"])
def test_group_comes_back_and_a_log_without_one_says_nothing(tmp_path, group):
    first, second = rewritten(replace(driving(), group=group), tmp_path)
    assert first == second
    assert read_recording(tmp_path / "first.mcap").group == group
    with LogReader(tmp_path / "first.mcap") as log:
        assert log.scene.group == group
        assert ("group" in log.scene.to_metadata()) == bool(group)


def test_motion_between_and_at_the_stamps_of_moments_stays_where_it_was(tmp_path):
    first, second, third, *_ = driving().moments()
    at_the_stamp_of_the_last = replace(second.motion[0], stamp_ns=first.stamp_ns, speed_mps=9.0)
    between = replace(second.motion[0], stamp_ns=first.stamp_ns + FRAME_NS // 3)
    second = replace(second, motion=(at_the_stamp_of_the_last, between, *second.motion))
    once, again = rewritten(moments_of(first, second, replace(third, motion=())), tmp_path)
    assert once == again
    assert [len(moment.motion) for moment in read_recording(tmp_path / "first.mcap").moments()] == [1, 3, 0]


def test_moments_without_cameras_or_truth_come_back(tmp_path):
    first, second, third, *_ = driving().moments()
    bare = replace(second, cameras={}, pose=None, actors=None)
    once, again = rewritten(moments_of(first, bare, third), tmp_path)
    assert once == again
    assert list(read_recording(tmp_path / "first.mcap").moments())[1] == bare


@given(st.floats(-100.0, 100.0))
def test_pose_that_was_read_gives_the_same_message(yaw_rad):
    written = codec.pose_message(Pose(START_NS, 1.0, 2.0, yaw_rad), "map").SerializeToString()
    assert codec.pose_message(codec.read_pose(written), "map").SerializeToString() == written


def test_damage_in_a_moment_is_named_with_the_log(tmp_path):
    path = tmp_path / "log.mcap"
    write_log(driving(), path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(LogError, match=r"log\.mcap: is damaged"):
        list(read_recording(path).moments())


def test_damaged_source_file_is_an_error(tmp_path):
    path = tmp_path / "log.mcap"
    write_log(driving(), path)
    data = path.read_bytes()
    assert data.count(b'{"a": 1}') == 1
    path.write_bytes(data.replace(b'{"a": 1}', b'{"a": 2}'))
    with pytest.raises(LogError, match=r"the checksum of attachment 'front_camera\.json' does not match"):
        read_recording(path)


def test_errors_of_the_consumer_are_not_taken_for_damage(tmp_path):
    write_log(driving(), tmp_path / "log.mcap")
    with pytest.raises(ValueError, match="mine"):  # noqa: PT012 - the loop's body is what raises
        for _ in read_recording(tmp_path / "log.mcap").moments():
            raise ValueError("mine")


@pytest.mark.parametrize("changed", [{"name": "../street"}, {"split": ".."}, {"name": ""}])
def test_log_whose_name_leads_elsewhere_is_refused(tmp_path, changed, monkeypatch):
    monkeypatch.setattr("semgrid_eval.log.store.require_file_name", lambda *_: None)  # as another writer would
    write_log(replace(driving(), **changed), tmp_path / "log.mcap")
    with pytest.raises(LogError, match="is not a file name"):
        LogReader(tmp_path / "log.mcap")
