"""At which times there are grids, and which sensor's pictures go with them."""

from dataclasses import replace

import numpy as np
import pytest
from support.driving import driving
from support.swept import START_NS, Drive, recorded, scanned, seen
from support.toy_world import Mount, street

from semgrid_eval.errors import LogError
from semgrid_eval.grids.shown import frame_poses, shown_camera, shown_lidar
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.motion import EgoMotion
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.kinds import KINDS, Kind
from semgrid_eval.sensors.lidar import ColourFrom, LidarSensor
from semgrid_eval.sensors.sensor import Points, SensorConfig
from semgrid_eval.sensors.tracks import TracksSensor

LIDAR = LidarSensor(lidar="top")


@pytest.fixture
def opened(tmp_path):
    """Write a recording, and open its log."""
    logs = []

    def opening(recording):
        write_log(recording, tmp_path / "log.mcap")
        logs.append(LogReader(tmp_path / "log.mcap"))
        return logs[-1]

    yield opening
    for log in logs:
        log.close()


def led_by(sensor, **others):
    return GridConfig(sensors={"first": sensor, **others}, target=("first",), integrator="arc")


def rig(*cameras):
    """A drive with cameras and a LiDAR at every second of their frames."""
    world = replace(street(1, frames=5), cameras={name: Mount() for name in cameras})

    def moments():
        for index, moment in enumerate(world.recording().moments()):
            sweeps = {} if index % 2 else {"top": seen(moment.stamp_ns, (0, 0, 0), [(9, 2)])}
            yield replace(moment, sweeps=sweeps)

    return replace(world.recording(), moments=moments)


def test_poses_are_those_of_the_times_of_the_leading_sensor(opened):
    cameras = {"front": Mount(), "left": Mount(1.5, 20_000_000)}
    log = opened(street(1, frames=3, cameras=cameras).recording())
    poses = frame_poses(log, led_by(CameraSensor(camera="left")))
    motion = EgoMotion(log.motion(), "arc")
    assert poses == [motion.pose_at(frame.stamp_ns) for frame in log.frames("left")]
    assert poses[1].x_m > poses[0].x_m > 0


def test_of_a_lidar_these_are_the_times_of_its_sweeps(opened):
    log = opened(rig("front"))
    assert [pose.stamp_ns for pose in frame_poses(log, led_by(LIDAR))] == [each.stamp_ns for each in log.sweeps("top")]
    with pytest.raises(LogError, match="lidar: 'low' is not top, the only choice"):
        frame_poses(log, led_by(LidarSensor(lidar="low")))


def test_of_tracks_these_are_the_times_of_actors(opened):
    log = opened(driving())
    times_ns = [stamp_ns for stamp_ns, _ in log.actors()]
    assert times_ns
    assert [pose.stamp_ns for pose in frame_poses(log, led_by(TracksSensor()))] == times_ns


def test_a_kind_without_a_topic_is_asked_for_its_points(opened, monkeypatch):
    class Radar(SensorConfig):
        kind: str = "radar"

    def read(log, sensors, class_by_label):
        nothing = np.empty(0)
        for name in sensors:
            yield Points(name, START_NS + 7, nothing, nothing, nothing.astype(np.uint8))

    monkeypatch.setitem(KINDS, "radar", Kind(Radar, read))
    poses = frame_poses(opened(rig("front")), GridConfig(sensors={"full": Radar()}))
    assert [pose.stamp_ns for pose in poses] == [START_NS + 7]


@pytest.mark.parametrize(
    ("cameras", "grid", "expected"),
    [
        (("front", "rear"), led_by(CameraSensor(camera="rear")), "rear"),
        (("front", "rear"), led_by(LIDAR), "front"),
        (("left", "rear"), led_by(LIDAR), "left"),
        (("front", "rear"), led_by(LIDAR, second=CameraSensor(camera="rear")), "rear"),
        (("front", "rear"), led_by(LidarSensor(colour_from=ColourFrom(camera="rear"))), "rear"),
        (("front", "rear"), led_by(LIDAR, second=CameraSensor(camera="gone")), "front"),
    ],
)
def test_the_camera_that_leads_is_shown_or_one_of_the_grid_or_one_of_the_log(opened, cameras, grid, expected):
    log = opened(rig(*cameras))
    assert shown_camera(log, grid) == expected
    assert shown_lidar(log, grid) is None


def test_without_a_camera_the_lidar_that_leads_is_shown_and_tracks_have_none(opened):
    log = opened(recorded(scanned(Drive(), [0], [(9.0, 2.0)]).moments))
    assert shown_camera(log, led_by(LidarSensor())) is None
    assert shown_lidar(log, led_by(LidarSensor())) == "top"
    assert shown_lidar(log, led_by(TracksSensor())) is None
