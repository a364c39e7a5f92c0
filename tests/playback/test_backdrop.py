import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from semgrid_eval.playback.drive import Drive
from support.driving import FRAME_NS, START_NS, driving

from semgrid_eval.errors import LogError
from semgrid_eval.log.codec import stamp_ns
from semgrid_eval.log.store import LogReader, write_log
from semgrid_eval.log.topics import TRANSFORMS


@pytest.fixture
def log(tmp_path):
    write_log(driving(cameras=("front", "rear")), tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as reader:
        yield reader


def sent(drive, first, last, **options):
    choice = {"shift_ns": 0, "grid_yaw_rad": 0.0, **options}
    return list(drive.messages(START_NS + first * FRAME_NS, START_NS + last * FRAME_NS, **choice))


def test_pictures_of_all_cameras_come_between_two_times_with_their_calibration(log):
    messages = sent(Drive(log, "front"), 2, 4)
    assert [message.log_ns for message in messages] == sorted(message.log_ns for message in messages)
    shown = [((m.log_ns - START_NS) // FRAME_NS, m.topic) for m in messages if m.topic != TRANSFORMS]
    # Every second frame has a label, every third a colour image.
    assert sorted(shown) == [
        (frame, f"/camera/{camera}/{channel}")
        for frame, channels in (
            (2, ("calibration", "label")),
            (3, ("calibration", "image")),
            (4, ("calibration", "label")),
        )
        for camera in ("front", "rear")
        for channel in channels
    ]
    assert sum(message.topic == TRANSFORMS for message in messages) == 3


def test_pictures_are_those_of_the_log(log):
    kept = [frame.label_png for frame in log.frames("rear") if frame.label_png]
    found = [m.message.data for m in sent(Drive(log, "front"), 0, 5) if m.topic == "/camera/rear/label"]
    assert found == kept


def test_a_shift_moves_all_times(log):
    plain, shifted = sent(Drive(log, "front"), 0, 5), sent(Drive(log, "front"), 0, 5, shift_ns=-7)
    assert [message.log_ns - 7 for message in plain] == [message.log_ns for message in shifted]
    for message in shifted:
        inner = message.message.transforms[0] if message.topic == TRANSFORMS else message.message
        assert stamp_ns(inner.timestamp) == message.log_ns


def test_transforms_are_those_of_the_log(log):
    kept = [data for _, _, data in log.messages([TRANSFORMS])]
    found = [
        m.message.SerializeToString(deterministic=True)
        for m in sent(Drive(log, "front"), 0, 5)
        if m.topic == TRANSFORMS
    ]
    assert found == kept


def test_frames_are_found_by_their_times(log):
    drive = Drive(log, "rear")
    assert drive.frame_at(START_NS + 3 * FRAME_NS) == 3
    assert drive.stamp_ns(3) == START_NS + 3 * FRAME_NS
    with pytest.raises(LogError, match=r"log.mcap: has no frame at 17 ns"):
        drive.frame_at(17)


@pytest.mark.parametrize(("camera", "name"), [(None, "not given"), ("side", "side")])
def test_a_camera_that_is_not_there_is_named(log, camera, name):
    with pytest.raises(LogError, match=rf"{name}.* is not one of: front, rear"):
        Drive(log, camera)


def test_a_picture_without_its_data_is_damage(log, monkeypatch):
    broken = CompressedImage(data=b"no picture").SerializeToString()
    drive = Drive(log, "front")
    monkeypatch.setattr(log, "messages", lambda names: iter([("/camera/front/image", START_NS, broken)]))
    with pytest.raises(LogError, match=r"log.mcap: /camera/front/image: "):
        sent(drive, 0, 5)
