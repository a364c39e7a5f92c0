import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from support.driving import FRAME_NS, START_NS, driving
from support.own_clock import with_own_motion
from support.toy_world import street

from semgrid_eval.errors import LogError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.codec import stamp_ns
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.log.topics import TRANSFORMS
from semgrid_eval.playback.backdrop import Backdrop
from semgrid_eval.sensors.camera import CameraSensor


@pytest.fixture
def log(tmp_path):
    write_log(driving(cameras=("front", "rear")), tmp_path / "log.mcap")
    with LogReader(tmp_path / "log.mcap") as reader:
        yield reader


def grid_of(camera, **changes):
    return GridConfig(sensors={"full": CameraSensor(camera=camera)}, **changes)


def sent(backdrop, first, last, **options):
    choice = {"shift_ns": 0, "grid_yaw_rad": 0.0, **options}
    return list(backdrop.messages(START_NS + first * FRAME_NS, START_NS + last * FRAME_NS, **choice))


def test_pictures_of_all_cameras_come_between_two_times_with_their_calibration(log):
    messages = sent(Backdrop(log, grid_of("front")), 2, 4)
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
    found = [m.message.data for m in sent(Backdrop(log, grid_of("front")), 0, 5) if m.topic == "/camera/rear/label"]
    assert found == kept


def test_a_shift_moves_all_times(log):
    plain, shifted = (
        sent(Backdrop(log, grid_of("front")), 0, 5),
        sent(Backdrop(log, grid_of("front")), 0, 5, shift_ns=-7),
    )
    assert [message.log_ns - 7 for message in plain] == [message.log_ns for message in shifted]
    for message in shifted:
        inner = message.message.transforms[0] if message.topic == TRANSFORMS else message.message
        assert stamp_ns(inner.timestamp) == message.log_ns


def test_transforms_are_those_of_the_log(log):
    kept = [data for _, _, data, _ in log.messages([TRANSFORMS])]
    found = [
        m.message.SerializeToString(deterministic=True)
        for m in sent(Backdrop(log, grid_of("front")), 0, 5)
        if m.topic == TRANSFORMS
    ]
    assert found == kept


@pytest.mark.parametrize("integrator", ["euler", "arc"])
def test_the_vehicle_moves_as_the_grids_do_where_frames_lie_between_motion_samples(tmp_path, integrator):
    grid = grid_of("front", integrator=integrator)
    write_log(with_own_motion(street(0, frames=8).recording()), tmp_path / "toy.mcap")
    (recording,) = build_log(tmp_path / "toy.mcap", grid)
    with LogReader(tmp_path / "toy.mcap") as reader:
        backdrop = Backdrop(reader, grid)
        first, last = (int(recording.stamps_ns[place]) for place in (0, -1))
        sent_tf = [m for m in backdrop.messages(first, last, shift_ns=0, grid_yaw_rad=0.0) if m.topic == TRANSFORMS]
        yaw_rad = [backdrop.poses[frame].yaw_rad for frame in range(8)]
    np.testing.assert_allclose(np.subtract(yaw_rad, yaw_rad[0]), recording.yaw_rad, atol=1e-12)
    places = [message.message.transforms[0].translation for message in sent_tf]
    away_m = np.array([(place.x - places[0].x, place.y - places[0].y) for place in places])
    turned_m = SE2(0.0, 0.0, yaw_rad[0]).apply(recording.position_m)
    np.testing.assert_allclose(away_m, turned_m, atol=1e-12)


def test_frames_are_found_by_their_times(log):
    backdrop = Backdrop(log, grid_of("rear"))
    assert backdrop.frame_at(START_NS + 3 * FRAME_NS) == 3
    assert backdrop.poses[3].stamp_ns == START_NS + 3 * FRAME_NS
    with pytest.raises(LogError, match=r"log.mcap: has no frame at 17 ns"):
        backdrop.frame_at(17)


@pytest.mark.parametrize(
    ("camera", "told"), [(None, "there are several, name one: front"), ("side", "'side' is not one of front")]
)
def test_a_camera_that_is_not_there_is_named(log, camera, told):
    with pytest.raises(LogError, match=f"camera: {told}, rear"):
        Backdrop(log, grid_of(camera))


def test_a_picture_without_its_data_is_damage(log, monkeypatch):
    broken = CompressedImage(data=b"no picture").SerializeToString()
    backdrop = Backdrop(log, grid_of("front"))
    monkeypatch.setattr(log, "messages", lambda names: iter([("/camera/front/image", START_NS, broken, START_NS)]))
    with pytest.raises(LogError, match=r"log.mcap: /camera/front/image: "):
        sent(backdrop, 0, 5)
