import re

import numpy as np
import pytest
from support.driving import driving
from support.single import single
from support.toy_world import Mount, street

from semgrid_eval.classes import DEFAULT_CLASSES, NO_POINT
from semgrid_eval.errors import LogError
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording import png
from semgrid_eval.sensors.camera import CameraSensor, read_cameras
from semgrid_eval.sensors.kinds import misfit, times_of
from semgrid_eval.sensors.lidar import ColourFrom, LidarSensor


@pytest.fixture
def log(tmp_path):
    cameras = {"front": Mount(), "left": Mount(1.5, 20_000_000)}
    write_log(street(1, frames=3, cameras=cameras).recording(), tmp_path / "toy.mcap")
    with LogReader(tmp_path / "toy.mcap") as reader:
        yield reader


def read(log, **sensors):
    return list(read_cameras(log, sensors, DEFAULT_CLASSES.class_by_label()))


def test_a_part_of_an_image_holds_the_points_of_its_pixels_alone(log):
    part = CameraSensor(camera="front", top_px=100, bottom_px=180, left_px=7, right_px=300)
    whole, some = read(log, whole=CameraSensor(camera="front"), some=part)[:2]
    assert (whole.sensor, some.sensor, whole.stamp_ns) == ("whole", "some", some.stamp_ns)
    assert (whole.class_id != NO_POINT).sum() > (some.class_id != NO_POINT).sum() > 1000
    for name in ("forward_m", "left_m", "class_id"):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[100:180, 7:300])


def test_cameras_come_in_the_order_of_time_and_images_are_decoded_once(log, monkeypatch):
    decoded = []
    decode = png.decode_gray
    monkeypatch.setattr(png, "decode_gray", lambda *args, **kinds: decoded.append(1) or decode(*args, **kinds))
    front, left = CameraSensor(camera="front"), CameraSensor(camera="left")
    points = read(log, a=front, b=CameraSensor(camera="front", image_size_px=(256, 128)), c=left, d=left)
    assert [each.sensor for each in points] == [*"abcd"] * 3
    assert [each.stamp_ns for each in points] == sorted(each.stamp_ns for each in points)
    assert points[2].stamp_ns - points[0].stamp_ns == 20_000_000
    assert len(decoded) == 2 * 2 * 3, "label and disparity of two cameras and three frames"
    assert points[1].class_id.shape == (128, 256)


def test_a_log_of_several_cameras_wants_a_name_and_a_frame_wants_labels(log, tmp_path):
    with pytest.raises(LogError, match=r"toy.mcap: camera: there are several, name one: front, left"):
        read(log, any=CameraSensor())
    write_log(driving(), tmp_path / "bare.mcap")
    with LogReader(tmp_path / "bare.mcap") as bare, pytest.raises(LogError, match="has no label image"):
        read(bare, any=CameraSensor())


def test_parts_belong_together_if_their_camera_is_the_same_or_the_only_one():
    assert CameraSensor().shares_image_with(CameraSensor(top_px=9))
    assert CameraSensor(camera="rear").shares_image_with(CameraSensor())
    assert not CameraSensor(camera="rear").shares_image_with(CameraSensor(camera="front"))
    assert CameraSensor(bottom_px=256).is_whole_image
    assert not CameraSensor(bottom_px=255).is_whole_image


def test_a_camera_without_disparity_is_told_with_what_it_can_do_before_anything_is_read(tmp_path):
    recording = street(1, frames=1, cameras={"front": Mount(), "left": Mount(1.5)}).recording()
    write_log(single(recording, "left"), tmp_path / "log.mcap")
    line = r"log\.mcap: camera left: has no disparity, .* \{kind: lidar, colour_from: \{camera: left\}\}$"
    both = {"a": CameraSensor(camera="front"), "b": CameraSensor(camera="left")}
    with LogReader(tmp_path / "log.mcap") as log:
        with pytest.raises(LogError, match=line):
            read_cameras(log, both, DEFAULT_CLASSES.class_by_label())
        with pytest.raises(LogError, match=line):
            times_of(log, both["b"])
        assert re.search(line, misfit(log, both.values()))
        assert misfit(log, [both["a"]]) is None
        coloured = LidarSensor(colour_from=ColourFrom(camera="left"))
        assert misfit(log, [coloured]).endswith("lidar: the log has none")


def test_a_damaged_calibration_is_the_logs_fault_and_no_misfit(tmp_path, monkeypatch):
    write_log(street(1, frames=1).recording(), tmp_path / "log.mcap")

    def damaged(log, camera):
        raise LogError("is damaged", path=log.path)

    monkeypatch.setattr(LogReader, "calibration", damaged)
    with LogReader(tmp_path / "log.mcap") as log, pytest.raises(LogError, match=r"log\.mcap: is damaged"):
        misfit(log, [CameraSensor()])
