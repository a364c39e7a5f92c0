"""What `check` finds about damage, times, motion, actors, types and contracts."""

import math
import random
from dataclasses import replace

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from support.bad.logs import as_it_is, copy
from support.checked_logs import findings, smooth, with_frame
from support.driving import CALIBRATION, FRAME_NS, START_NS, driving

from semgrid_eval.log.check import check_log
from semgrid_eval.log.codec import PLAYBACK_RECORD, PREDICTIONS_RECORD, image_message
from semgrid_eval.log.contract import Contract, Range, TopicContract
from semgrid_eval.log.findings import Severity
from semgrid_eval.log.store import write_log
from semgrid_eval.log.writer import MessageWriter


@pytest.fixture(autouse=True)
def by_another_writer(monkeypatch):
    """Let logs be written that a conversion refuses."""
    monkeypatch.setattr("semgrid_eval.log.writer.implausible", lambda sample: None)


def with_motion(moment, **changes):
    return replace(moment, motion=(replace(moment.motion[0], **changes),))


def test_good_log_has_no_findings_and_its_messages_are_counted(tmp_path):
    assert findings(tmp_path) == {}
    report = check_log(tmp_path / "log.mcap")
    assert report.good
    assert report.counts["/camera/front/disparity"] == 8
    assert report.counts["/tf"] == 8
    assert report.duration_s == pytest.approx(7 * FRAME_NS / 1e9)


def test_any_damage_is_an_error(tmp_path):
    write_log(replace(driving(), moments=smooth), tmp_path / "log.mcap")
    whole = (tmp_path / "log.mcap").read_bytes()
    chance = random.Random(1)
    for _ in range(60):
        data = bytearray(whole)
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        (tmp_path / "log.mcap").write_bytes(data)
        report = check_log(tmp_path / "log.mcap")
        assert not report.good
        assert report.findings[0].place == "file"
    (tmp_path / "log.mcap").write_bytes(whole[:-100])
    assert "its end is missing" in check_log(tmp_path / "log.mcap").findings[0].message


def test_missing_labels_and_images_are_counted(tmp_path):
    def change(number, moment):
        return with_frame(moment, label_png=None) if number < 3 else with_frame(moment, image_file=None)

    assert findings(tmp_path, change) == {
        f"/camera/front/{channel}: missing_beside": (
            Severity.WARNING,
            f"is missing{hint} for {count} of 8 messages of /camera/front/disparity (allowed: at most 0)",
        )
        for channel, hint, count in (("label", " (`semgrid-eval segment` adds it)", 3), ("image", "", 5))
    }


def test_log_without_frames_or_motion_is_an_error(tmp_path):
    found = findings(tmp_path, lambda number, moment: replace(moment, cameras={}, motion=()))
    for topic in ("/camera/front/disparity", "/ego/motion"):
        assert found[f"{topic}: messages"] == (Severity.ERROR, "has 0 messages (allowed: at least 1)")
    assert "cannot be looked at without proper messages of /camera/front/disparity," in found["camera front"][1]


def shifted(moment, by_ns):
    stamp_ns = moment.stamp_ns + by_ns
    moment = replace(with_frame(moment, stamp_ns=stamp_ns), stamp_ns=stamp_ns)
    return with_motion(moment, stamp_ns=stamp_ns)


def test_gap_in_time_is_a_warning(tmp_path):
    found = findings(tmp_path, lambda number, moment: shifted(moment, FRAME_NS * 4 if number > 5 else 0))
    expected = (Severity.WARNING, "has a gap of 0.294 s at a period of 0.059 s (allowed: at most 1.5)")
    assert found == {f"{topic}: gap_periods": expected for topic in ("/camera/front/disparity", "/ego/motion")}


def test_jitter_is_a_warning(tmp_path):
    found = findings(tmp_path, lambda number, moment: shifted(moment, FRAME_NS // 5 * (number % 2)))
    assert "vary by" in found["/camera/front/disparity: jitter_periods"][1]


def test_repeated_time_is_an_error(tmp_path):
    found = findings(tmp_path, lambda number, moment: shifted(moment, -FRAME_NS if number == 5 else 0))
    text = "has 1 message with the time of the message before (allowed: at most 0)"
    assert found["/ego/motion: repeated_times"] == (Severity.ERROR, text)
    assert found["/camera/front/disparity: repeated_times"][0] is Severity.ERROR


def test_frames_outside_the_time_of_the_motion_are_a_warning(tmp_path):
    found = findings(tmp_path, lambda number, moment: replace(moment, motion=()) if number == 7 else moment)
    text = "leaves out 0.059 s of the time of /camera/front/calibration (allowed: at most 0)"
    assert found == {"/ego/motion: uncovered_s": (Severity.WARNING, text)}


@pytest.mark.parametrize(
    ("changes", "place", "severity"),
    [
        ({"speed_mps": 90.0}, "speed_mps", Severity.ERROR),
        ({"speed_mps": -30.0}, "speed_mps", Severity.ERROR),
        ({"yaw_rate_radps": 5.7}, "yaw_rate_radps", Severity.ERROR),
    ],
)
def test_impossible_motion_is_an_error(tmp_path, changes, place, severity):
    found = findings(tmp_path, lambda number, moment: with_motion(moment, **changes))
    assert found[f"/ego/motion: {place}"][0] is severity


def test_jump_in_speed_is_a_warning(tmp_path):
    found = findings(tmp_path, lambda number, moment: with_motion(moment, speed_mps=20.0 if number == 4 else 8.0))
    assert found["/ego/motion: acceleration_mps2"][0] is Severity.WARNING


@pytest.mark.parametrize("speed_mps", [float("nan"), float("inf")])
def test_motion_that_is_no_number_is_an_error(tmp_path, speed_mps):
    path = tmp_path / "log.mcap"
    samples = smooth(lambda number, moment: with_motion(moment, speed_mps=speed_mps) if number == 3 else moment)
    write_log(replace(driving(), moments=lambda: samples), path)
    assert not check_log(path).good


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"x_m": math.nan}, "actor 301 is not at a finite place"),
        ({"length_m": 0.0}, "actor 301 is 0 x 1.75 m; 0 to 200 m are allowed"),
        ({"velocity_y_mps": math.inf}, "actor 301 has a height or velocity that is not finite"),
    ],
)
def test_impossible_actors_are_one_error(tmp_path, change, fault):
    def spoiled(number, moment):
        if number != 5:
            return moment
        first, second = moment.actors
        return replace(moment, actors=(first, replace(second, **change)))

    stamp_ns = START_NS + 5 * FRAME_NS
    assert findings(tmp_path, spoiled) == {"/truth/actors": (Severity.ERROR, f"at {stamp_ns} ns: {fault}")}


def test_true_pose_that_is_not_finite_is_an_error(tmp_path):
    def spoiled(number, moment):
        return replace(moment, pose=replace(moment.pose, yaw_rad=math.nan)) if number == 2 else moment

    told = f"is not finite at {START_NS + 2 * FRAME_NS} ns"
    assert findings(tmp_path, spoiled) == {"/truth/pose": (Severity.ERROR, told)}


@pytest.mark.parametrize("topic", ["/ego/motion", "/truth/actors", "/camera/front/label", "/camera/front/stereo"])
def test_messages_of_another_type_are_an_error_and_the_rest_is_checked(tmp_path, topic):
    path = tmp_path / "log.mcap"
    write_log(replace(driving(), moments=smooth), path)
    with path.open("rb") as old, (tmp_path / "new.mcap").open("wb") as stream:
        writer = Writer(stream, enable_data_crcs=True)
        writer.start(profile="", library="")
        copy(make_reader(old), writer, as_it_is, None, {"types": {topic: "foxglove.Grid"}})
        writer.finish()
    report = check_log(tmp_path / "new.mcap")
    assert report.is_readable
    told = [str(finding) for finding in report.findings]
    assert told[0].startswith(f"error: {topic}: type: holds foxglove.Grid messages; ")
    camera = "error: camera front: cannot be looked at without proper messages of"
    assert told[1:] == ([f"{camera} {topic}"] if topic.startswith("/camera") else [])


@pytest.mark.parametrize(
    ("record", "told"),
    [
        (PLAYBACK_RECORD, "is a run to be watched, as `semgrid-eval play` writes it, not a recording"),
        (PREDICTIONS_RECORD, "holds predictions, not a recording"),
        ("another", "has no metadata record semgrid.scene; it was not written by semgrid-eval"),
    ],
)
def test_logs_that_are_not_recordings_are_named_as_what_they_are(tmp_path, record, told):
    with (tmp_path / "log.mcap").open("wb") as stream, MessageWriter(stream) as writer:
        writer.metadata(record, {"a": "b"})
    (finding,) = check_log(tmp_path / "log.mcap").findings
    assert finding.message == told


def test_a_damaged_attachment_is_an_error_where_no_checksum_of_all_data_tells(tmp_path):
    path = tmp_path / "log.mcap"
    write_log(replace(driving(), source_files={"notes.txt": b"precious notes"}), path)
    data = path.read_bytes().replace(b"precious notes", b"precious votes")
    at = data.rindex(b"\x0f\x04" + bytes(7))  # the record that ends the data: its checksum is optional
    path.write_bytes(data[: at + 9] + bytes(4) + data[at + 13 :])
    found = [finding for finding in check_log(path).findings if finding.severity is Severity.ERROR]
    assert [finding.message for finding in found] == [
        "is damaged: the checksum of attachment 'notes.txt' does not match"
    ]


def test_pictures_and_motion_whose_stamps_are_not_their_times_are_errors(tmp_path, monkeypatch):
    def late(stamp_ns, camera, png):
        return image_message(stamp_ns - 5_000_000, camera, png)

    monkeypatch.setattr("semgrid_eval.log.codec.image_message", late)
    text = "log is up to 0.005 s after stamp in 8 of 8 messages (allowed: 0 to 0)"
    expected = (Severity.ERROR, text)
    assert findings(tmp_path) == {f"/camera/front/{each}: latency": expected for each in ("disparity", "label")}


def test_what_a_contract_leaves_out_is_not_looked_at(tmp_path):
    assert findings(tmp_path, lambda number, moment: with_motion(moment, speed_mps=90.0))
    assert check_log(tmp_path / "log.mcap", Contract()).findings == ()


@pytest.mark.parametrize(
    ("topic", "name", "value"),
    [
        ("/ego/motion", "speed_mps", 8),
        ("/ego/motion", "acceleration_mps2", 0),
        ("/camera/{camera}/calibration", "fx_px", 70.5),
        ("/camera/{camera}/calibration", "v0_px / height", 15.75 / 32),
        ("/camera/front/stereo", "z_m", 1.22),
        ("/camera/{camera}/disparity", "width_px", 64),
        ("/camera/{camera}/disparity", "height_px", 32),
    ],
)
def test_every_value_can_be_held_to_a_range(tmp_path, topic, name, value):
    findings(tmp_path)

    def broken(**limit):
        contract = Contract(topics={topic: TopicContract(values={name: Range(**limit)})})
        return [finding.place for finding in check_log(tmp_path / "log.mcap", contract).findings]

    assert broken(low=value, high=value) == []
    assert broken(low=value + 0.01) == broken(high=value - 0.01) == [f"{topic.format(camera='front')}: {name}"]


def test_a_channel_of_another_type_is_an_error(tmp_path):
    findings(tmp_path)
    contract = Contract(topics={"/tf": TopicContract(type="geometry_msgs/Pose")})
    (found,) = check_log(tmp_path / "log.mcap", contract).findings
    assert str(found) == "error: /tf: type: holds foxglove.FrameTransforms messages; geometry_msgs/Pose is needed"


def test_a_name_that_holds_the_end_of_a_line_is_told_in_one(tmp_path):
    path, cameras = tmp_path / "log.mcap", {"front": CALIBRATION, "a\nb": CALIBRATION}
    write_log(replace(driving(), moments=smooth, calibrations=cameras), path)
    found = [finding for finding in check_log(path).findings if finding.place == "camera a\nb"]
    assert [str(finding).partition(": cannot")[0] for finding in found] == ["error: camera a\\nb"]
