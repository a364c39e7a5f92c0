"""LiDARs in grids: where their points lie, at what time, and beside cameras of another clock."""

import heapq
import math
from dataclasses import replace

import numpy as np
import pytest
from support.poles import POLE, Poles
from support.swept import START_NS, TURNED, Drive, recorded, scanned, seen, sweep
from support.toy_world import FRAME_NS, Mount, ToyWorld

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, LogError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.lidar import Mount as LidarMount
from semgrid_eval.recording.types import Moment, MotionSample
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.lidar import LidarSensor

CAR = CLASS_NAMES.index("car")
SPEC = GridSpec(rows=400, columns=400, cell_m=0.1, agent_row=300, agent_column=250)
LIDAR_NS, LATE_NS = 100_000_000, 30_000_000  # 10 Hz, and how much later the camera begins, at 17 Hz
PLACES = [(x + 0.15, 9.15) for x in range(2, 30, 3)]
POLES = Poles(PLACES, SPEC)


def built(recording, folder, **settings):
    write_log(recording, folder / "log.mcap")
    (grids,) = build_log(folder / "log.mcap", GridConfig(spec=SPEC, integrator="arc", **settings))
    return grids


def test_points_stand_where_they_are_whatever_the_lidars_place_and_turn(tmp_path):
    drive = Drive(speed_mps=12.0, yaw_rate_radps=0.6)
    grids = built(
        scanned(drive, range(0, 10**9, LIDAR_NS), PLACES),
        tmp_path,
        sensors={"top": LidarSensor()},
        target=("top",),
    )
    for frame in range(10):
        places_m = POLES.found_m(grids.grids[0, frame])
        assert len(places_m) >= 5
        assert POLES.away_m(places_m, drive.pose_at(frame * LIDAR_NS)).max() <= 0.05 * math.sqrt(2) + 1e-3


def fused(drive):
    """A LiDAR at 10 Hz, a camera at 17 Hz that is 30 ms late, and motion at 50 Hz."""
    cameras = {"front": Mount(yaw_rad=0.5, late_ns=LATE_NS)}
    world = ToyWorld(
        POLES.boxes, speed_mps=drive.speed_mps, yaw_rate_radps=drive.yaw_rate_radps, frames=16, cameras=cameras
    )

    def moments():
        pictures = (replace(moment, motion=()) for moment in world.recording().moments())
        scans = (
            Moment(START_NS + since, {}, sweeps={"top": seen(START_NS + since, drive.pose_at(since), PLACES)})
            for since in range(0, 10**9, LIDAR_NS)
        )
        rates = (drive.speed_mps, drive.yaw_rate_radps)
        samples = [MotionSample(START_NS + since, *rates) for since in range(0, 10**9 + 1, 20_000_000)]
        for moment in heapq.merge(pictures, scans, key=lambda moment: moment.stamp_ns):
            due = sum(sample.stamp_ns <= moment.stamp_ns for sample in samples)
            yield replace(moment, motion=tuple(samples[:due]))
            del samples[:due]

    return replace(recorded(moments), calibrations={"front": world.calibration()})


SENSORS = {"top": LidarSensor(), "front": CameraSensor(morphology="off")}


def test_a_camera_at_17_hz_30_ms_late_stands_in_the_grids_of_a_lidar_at_10_hz(tmp_path):
    drive = Drive(speed_mps=12.0, yaw_rate_radps=0.6)
    grids = built(fused(drive), tmp_path, sensors=SENSORS, target=("top",))
    np.testing.assert_array_equal(grids.stamps_ns, START_NS + np.arange(10) * LIDAR_NS)
    assert not (grids.grids[1, 0] != UNKNOWN).any(), "the camera has seen nothing yet"
    found = 0
    for frame in range(1, 10):
        pose = drive.pose_at(frame * LIDAR_NS)
        for row, reach_m in ((0, 0.05 * math.sqrt(2) + 1e-3), (1, 0.15 * math.sqrt(2) + 0.15)):
            places_m = POLES.found_m(grids.grids[row, frame])
            found += len(places_m)
            assert (POLES.away_m(places_m, pose) < reach_m).all()
    assert found > 150


def test_a_lidar_stands_in_the_grids_of_a_camera_as_old_as_its_newest_sweep_is(tmp_path):
    drive = Drive(speed_mps=12.0, yaw_rate_radps=0.6)
    grids = built(fused(drive), tmp_path, sensors=SENSORS, target=("front",))
    times_ns = LATE_NS + np.arange(16) * FRAME_NS
    np.testing.assert_array_equal(grids.stamps_ns, START_NS + times_ns)
    start_rad = drive.pose_at(LATE_NS)[2]
    for frame, since_ns in enumerate(times_ns.tolist()):
        x_m, y_m, _ = drive.pose_at(since_ns)
        places_m = POLES.found_m(grids.grids[0, frame])
        turn = np.array([[math.cos(start_rad), math.sin(start_rad)], [-math.sin(start_rad), math.cos(start_rad)]])
        assert (POLES.away_m(places_m @ turn, (x_m, y_m)) < 0.05 * math.sqrt(2) + 1e-2).all()
    ages_ms = (times_ns % LIDAR_NS) / 1e6
    limit_s = float(np.median(ages_ms)) * 1e-3
    young = built(fused(drive), tmp_path, sensors={**SENSORS, "top": LidarSensor(max_age_s=limit_s)}, target=("front",))
    np.testing.assert_array_equal((young.grids[0] != UNKNOWN).any(axis=(1, 2)), ages_ms <= limit_s * 1e3)


def test_what_has_no_class_gives_no_point_and_classes_can_be_mapped(tmp_path):
    drive_ns = (0, LIDAR_NS)
    straight = LidarMount((0.0, 0.0, 1.8), (0.0, 0.0, 0.0, 1.0))

    def moments():
        for since in drive_ns:
            points = sweep(
                START_NS + since,
                [(5.05, 0.05, 0), (7.05, 0.05, 0), (9.05, 0.05, 0)],
                ["car", "sky", "terrain"],
                straight,
            )
            yield Moment(START_NS + since, {}, (MotionSample(START_NS + since, 0.0, 0.0),), sweeps={"top": points})

    settings = {"sensors": {"top": LidarSensor()}, "target": ("top",)}
    plain = built(recorded(moments), tmp_path, **settings).grids[0, 0]
    assert plain[SPEC.agent_row - 51, SPEC.agent_column - 1] == CAR
    assert np.count_nonzero(plain) == 2
    mapped = built(recorded(moments), tmp_path, class_map={"terrain": None}, **settings).grids[0, 0]
    assert np.count_nonzero(mapped) == 1


def test_the_papers_kernels_delete_a_ring_that_a_lidar_keeps(tmp_path):
    ring = [(8 * math.cos(a), 8 * math.sin(a), -1.8) for a in np.linspace(-0.5, 0.5, 400)]

    def moments():
        for since in (0, LIDAR_NS):
            points = sweep(START_NS + since, ring, ["road"] * len(ring))
            yield Moment(START_NS + since, {}, (MotionSample(START_NS + since, 0.0, 0.0),), sweeps={"top": points})

    known = {}
    for name, sensor in (("own", LidarSensor()), ("paper", LidarSensor(morphology="minkowski"))):
        known[name] = np.count_nonzero(
            built(recorded(moments), tmp_path, sensors={"top": sensor}, target=("top",)).grids[0, 0]
        )
    assert known["own"] > 80
    assert known["paper"] == 0


def test_sweeps_without_labels_and_logs_without_lidars_are_refused_in_a_line(tmp_path):
    bare = sweep(START_NS, [(5.0, 0.0, 0.0)])
    moment = Moment(START_NS, {}, (MotionSample(START_NS, 0.0, 0.0),), sweeps={"top": bare})
    settings = {"sensors": {"top": LidarSensor()}, "target": ("top",)}
    told = rf"log\.mcap: sweep of top at {START_NS} ns: has no labels; a grid needs them, or `colour_from`: a camera"
    with pytest.raises(LogError, match=told):
        built(recorded(lambda: iter([moment])), tmp_path, **settings)
    with pytest.raises(LogError, match=r"log\.mcap: lidar: the log has none$"):
        built(recorded(lambda: iter([replace(moment, sweeps={})])), tmp_path, **settings)
    with pytest.raises(ConfigError, match="top_px: unknown key; allowed here: colour_from, kind, lidar, max_age_s"):
        parse_config(GridConfig, {"sensors": {"full": {"kind": "lidar", "top_px": 3}}})


def test_two_sensors_of_one_lidar_share_its_sweeps(tmp_path):
    sensors = {"a": LidarSensor(), "b": LidarSensor(lidar="top", morphology="opencv")}
    grids = built(scanned(Drive(), (0, LIDAR_NS), PLACES, mount=TURNED), tmp_path, sensors=sensors, target=("a",))
    assert grids.sensors == ("a", "b")
    assert (grids.grids[0] == POLE).any()
