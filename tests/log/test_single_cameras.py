"""Logs of cameras without disparity: what is written comes back, is checked, and what contradicts itself is refused."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.driving import CALIBRATION, FRAME_NS, START_NS, driving
from support.independent_reader import of_topic, read, reader_script, sha256
from support.single import single

from semgrid_eval.errors import InputError
from semgrid_eval.log.check import check_log
from semgrid_eval.log.contract import load_contract
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import read_recording, write_log


def full(frames=4):
    """Two cameras, each with image and labels in every frame."""
    shown = next(driving(cameras=("front", "rear")).moments()).cameras

    def moments():
        for moment in driving(frames=frames).moments():
            sample = replace(moment.motion[0], speed_mps=8.0, yaw_rate_radps=0.1)
            cameras = {name: replace(frame, stamp_ns=moment.stamp_ns) for name, frame in shown.items()}
            yield replace(moment, motion=(sample,), cameras=cameras)

    return replace(driving(cameras=("front", "rear")), moments=moments)


def changed(recording, change):
    """Change the frames of the rear camera."""

    def moments():
        for moment in recording.moments():
            yield replace(moment, cameras={**moment.cameras, "rear": change(moment.cameras["rear"])})

    return replace(recording, moments=moments)


@pytest.fixture
def path(tmp_path):
    write_log(single(full(), "rear"), tmp_path / "log.mcap")
    return tmp_path / "log.mcap"


def test_frames_come_back_beside_those_of_a_camera_with_disparity(path):
    expected = list(single(full(), "rear").moments())
    with LogReader(path) as log:
        assert log.calibration("rear") == replace(CALIBRATION, baseline_m=None)
        assert log.calibration("front") == CALIBRATION
        assert (log.is_single("rear"), log.is_single("front")) == (True, False)
        assert log.image_size("rear") == log.image_size("front") == (64, 32)
        assert "/camera/rear/disparity" not in log.schemas()
        found = list(log.frames("rear", images=True))
        bare = list(log.frames("rear"))
        moments = list(log.moments())
    assert [each.image_file for each in found] == [each.cameras["rear"].image_file for each in expected]
    assert all(each.label_png and each.disparity_png is None for each in found)
    assert bare == [replace(each, image_file=None) for each in found]
    assert [each.cameras["rear"] for each in moments] == found


def test_without_labels_there_are_frames_all_the_same(tmp_path):
    write_log(changed(single(full(), "rear"), lambda frame: replace(frame, label_png=None)), tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as log:
        frames = list(log.frames("rear"))
    assert [each.stamp_ns for each in frames] == [START_NS + number * FRAME_NS for number in range(4)]
    assert {(each.image_file, each.label_png) for each in frames} == {(None, None)}


def test_labels_alone_are_enough_and_tell_the_size(tmp_path):
    write_log(changed(single(full(), "rear"), lambda frame: replace(frame, image_file=None)), tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as log:
        assert log.image_size("rear") == (64, 32)
        assert all(each.label_png for each in log.frames("rear"))


def test_labels_that_are_smaller_than_images_do_not_tell_what_a_camera_is_calibrated_for(tmp_path):
    small = cv2.imencode(".png", np.zeros((16, 32), np.uint8))[1].tobytes()

    def write(at, **changes):
        def change(frame):
            frame = replace(frame, label_png=small)
            return replace(frame, **changes) if frame.stamp_ns == START_NS + at * FRAME_NS else frame

        write_log(changed(single(full(), "rear"), change), tmp_path / "log.mcap")

    write(2, image_file=None)
    with LogReader(tmp_path / "log.mcap") as log:
        assert log.image_size("rear") == (64, 32)
    with pytest.raises(InputError, match=r"/camera/rear/image at \d+ ns: is 64 x 32; pictures before it are 32 x 16"):
        write(0, image_file=None)


def test_written_again_it_is_the_same_bytes(path, tmp_path):
    write_log(read_recording(path), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()


def test_an_independent_reader_opens_it(path):
    found = read(reader_script(), path)
    assert found["done"]
    frames = [moment.cameras["rear"] for moment in single(full(), "rear").moments()]
    images = [message["value"]["data"] for message in of_topic(found, "/camera/rear/image")]
    assert images == [sha256(frame.image_file) for frame in frames]
    (stereo,) = {message["value"].get("baseline_m", 0) for message in of_topic(found, "/camera/rear/stereo")}
    assert stereo == 0
    known = of_topic(found, "/camera/rear/calibration")[0]["value"]
    assert (known["width"], known["height"]) == (64, 32)


def test_check_finds_nothing_wrong_with_it(path):
    assert check_log(path).findings == ()


@pytest.mark.parametrize(
    ("change", "place", "text"),
    [
        ({"label_png": None}, "label: missing_beside", "is missing (`semgrid-eval segment` adds it) for 4 of 4"),
        ({"image_file": None}, "image: missing_beside", "is missing for 4 of 4 messages of /camera/rear/calibration"),
    ],
)
def test_check_tells_what_its_frames_lack(tmp_path, change, place, text):
    write_log(changed(single(full(), "rear"), lambda frame: replace(frame, **change)), tmp_path / "log.mcap")
    (finding,) = check_log(tmp_path / "log.mcap").findings
    assert finding.place == f"/camera/rear/{place}"
    assert finding.message.startswith(text)


def test_check_tells_gaps_and_a_calibration_that_cannot_be(tmp_path):
    recording = single(full(9), "rear")
    far = replace(recording.calibrations["rear"], z_m=40.0)
    recording = replace(recording, calibrations={**recording.calibrations, "rear": far})

    def moments():
        for number, moment in enumerate(recording.moments()):
            kept = {name: each for name, each in moment.cameras.items() if name == "front" or number != 4}
            yield replace(moment, cameras=kept)

    write_log(replace(recording, moments=moments), tmp_path / "log.mcap")
    places = [finding.place for finding in check_log(tmp_path / "log.mcap").findings]
    assert places == ["/camera/rear/calibration: gap_periods", "/camera/rear/stereo: z_m"]


def test_a_contract_tells_cameras_with_disparity_from_those_without(path, tmp_path):
    text = "topics:\n" + "".join(
        f"  /camera/{{{cameras}}}/{channel}: {{messages: {{low: 5}}, values: {{width_px: {{low: 65}}}}}}\n"
        for cameras, channel in (("single", "image"), ("stereo", "disparity"))
    )
    (tmp_path / "contract.yaml").write_text(text)
    found = [finding.place for finding in check_log(path, load_contract(tmp_path / "contract.yaml")).findings]
    assert found == [
        f"/camera/{topic}: {what}" for what in ("messages", "width_px") for topic in ("rear/image", "front/disparity")
    ]


@pytest.mark.parametrize(
    ("recording", "line"),
    [
        (
            changed(full(), lambda frame: replace(frame, disparity_png=None)),
            r"camera rear at \d+ ns: has no disparity; the calibration of a camera without has no baseline_m either$",
        ),
        (
            replace(full(), calibrations=single(full(), "rear").calibrations),
            r"camera rear at \d+ ns: has disparity, but its calibration no baseline_m$",
        ),
        (
            changed(single(full(), "rear"), lambda frame: replace(frame, image_file=None, label_png=None)),
            r"camera rear at \d+ ns: has neither disparity nor image nor labels$",
        ),
    ],
    ids=["baseline alone", "disparity alone", "nothing"],
)
def test_what_contradicts_itself_is_refused_and_nothing_written(tmp_path, recording, line):
    with pytest.raises(InputError, match=line):
        write_log(recording, tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []
