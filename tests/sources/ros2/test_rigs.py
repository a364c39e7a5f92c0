"""Bags with several cameras and LiDARs, each with its own mount and clock: one log, and one grid."""

import heapq
import math
from dataclasses import replace

import numpy as np
import pytest
from support import ros_messages as ros
from support.bags import write_bag
from support.commands import run_command
from support.kitti_tree import Sequence
from support.poles import POLE, Poles
from support.rig_bags import Coding, RigBag
from support.swept import START_NS, Drive, recorded, scanned, seen
from support.toy_world import FRAME_NS, ToyWorld
from support.toy_world import Mount as Turned

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.recording.lidar import Mount
from semgrid_eval.recording.types import Moment, MotionSample
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.lidar import LidarSensor
from semgrid_eval.sources.kitti.convert import convert_kitti
from semgrid_eval.sources.kitti.source import KittiOptions
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

SPEC = GridSpec(rows=400, columns=400, cell_m=0.1, agent_row=200, agent_column=200)
PLACES = [(x + 0.15, 9.15) for x in range(-24, 30, 3)]
POLES = Poles(PLACES, SPEC)
DRIVE = Drive(speed_mps=12.0, yaw_rate_radps=0.5)
LIDAR_NS, LATE_NS = 100_000_000, 30_000_000


def converted(here, messages, text, storage="mcap"):
    write_bag(here / "drive", messages, storage)
    (here / "map.yaml").write_text(text)
    summary = convert_bags(Ros2Options(bag=(here / "drive",), map=str(here / "map.yaml")), here / "logs")
    assert summary.failed == {}
    (log,) = find_logs(here / "logs")
    assert check_log(log).findings == ()
    return log, summary


def motion(times_ns):
    return [MotionSample(START_NS + since, DRIVE.speed_mps, DRIVE.yaw_rate_radps) for since in times_ns]


def merged(*streams, calibrations):
    """A recording of moments of several sensors, with motion at 50 Hz."""
    samples = motion(range(0, 10**9 + 1, 20_000_000))

    def moments():
        found = list(heapq.merge(*(list(stream()) for stream in streams), key=lambda moment: moment.stamp_ns))
        waiting = list(samples)
        for moment in found:
            due = sum(sample.stamp_ns <= moment.stamp_ns for sample in waiting)
            yield replace(moment, motion=tuple(waiting[:due]))
            del waiting[:due]
        yield Moment(waiting[-1].stamp_ns, {}, tuple(waiting))

    return replace(recorded(moments, "drive"), calibrations=calibrations)


class Surround(ToyWorld):
    """A world in which the rear camera stands elsewhere than the front one."""

    def calibration(self, camera="front"):
        told = super().calibration(camera)
        return replace(told, x_m=-0.9, y_m=-0.2, z_m=1.4) if camera == "rear" else told


def toy(**cameras):
    return Surround(
        POLES.boxes, speed_mps=DRIVE.speed_mps, yaw_rate_radps=DRIVE.yaw_rate_radps, frames=15, cameras=cameras
    )


def built(log, target, **sensors):
    config = GridConfig(spec=SPEC, integrator="arc", morphology="off", sensors=sensors, target=target)
    (grids,) = build_log(log, config)
    return grids


def test_front_and_rear_cameras_with_clocks_of_their_own_make_one_grid(tmp_path):
    world = toy(front=Turned(0.5), rear=Turned(2.4, LATE_NS))
    calibrations = {name: world.calibration(name) for name in ("front", "rear")}
    bag = RigBag(merged(lambda: world.recording().moments(), calibrations=calibrations))
    log, summary = converted(tmp_path, bag.messages(), bag.map_text())
    assert "30 of 30 frames; no frame left out" in summary.remark
    with LogReader(log) as reader:
        assert reader.scene.cameras == ("front", "rear")
        for name in reader.scene.cameras:
            told = vars(reader.calibration(name)).values()
            assert list(told) == pytest.approx(list(vars(calibrations[name]).values()), abs=1e-7)
    sensors = {name: CameraSensor(camera=name) for name in ("front", "rear")}
    grids = built(log, ("front", "rear"), **sensors)
    np.testing.assert_array_equal(grids.stamps_ns, START_NS + np.arange(15) * FRAME_NS)
    seen_by = {"front": 0, "rear": 0}
    for frame in range(1, 15):
        pose = DRIVE.pose_at(frame * FRAME_NS)
        for row, name in enumerate(seen_by):
            places_m = POLES.found_m(grids.grids[row, frame])
            seen_by[name] += len(places_m)
            assert (POLES.away_m(places_m, pose) < 0.15 * math.sqrt(2) + 0.15).all()
    assert min(seen_by.values()) > 100
    front, rear, both = grids.grids != UNKNOWN
    np.testing.assert_array_equal(both, front | rear)
    assert front[1:, :150].sum() > 3 * rear[1:, :150].sum()
    assert rear[1:, 210:].sum() > 3 * front[1:, 210:].sum()


def skewed(since_ns, parts=40):
    """A cloud of which each point was measured later than the one before, over a turn of the LiDAR."""
    mount = Mount((1.2, 0.3, 1.8), (0.0, 0.0, math.sin(0.2), math.cos(0.2)))
    offsets_ns = np.linspace(0, 0.9 * LIDAR_NS, len(PLACES)).astype(np.uint32)
    points = [
        seen(1, DRIVE.pose_at(since_ns + int(offset)), [place], mount=mount).points_m[0]
        for offset, place in zip(offsets_ns, PLACES, strict=True)
    ]
    found = np.zeros(len(points), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("label", "u1"), ("t", "u4")])
    found["x"], found["y"], found["z"] = np.array(points).T
    found["label"], found["t"] = 17, offsets_ns
    return found


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_lidar_at_10_hz_and_a_camera_at_17_hz_30_ms_late_agree_in_one_grid(tmp_path, storage):
    world = toy(front=Turned(0.5, LATE_NS))

    def scans():
        for since in range(0, 9 * LIDAR_NS, LIDAR_NS):
            yield Moment(START_NS + since, {}, sweeps={"top": seen(START_NS + since, DRIVE.pose_at(since), PLACES)})

    calibrations = {"front": world.calibration()}
    bag = RigBag(merged(lambda: world.recording().moments(), scans, calibrations=calibrations))
    messages = [
        each._replace(message=ros.cloud(stamp_of(each), skewed(stamp_of(each) - START_NS), frame="top"))
        if each.topic == "/top/points"
        else each
        for each in bag.messages()
    ]
    text = bag.map_text("times: {field: t, unit: ns}")
    log, summary = converted(tmp_path, messages, text, storage)
    assert "24 of 24 frames and sweeps; no frame left out" in summary.remark
    sensors = {"top": LidarSensor(), "front": CameraSensor()}
    grids = built(log, ("top", "front"), **sensors)
    np.testing.assert_array_equal(grids.stamps_ns, START_NS + np.arange(9) * LIDAR_NS)
    told = [0, 0]
    for frame in range(1, 9):
        pose = DRIVE.pose_at(frame * LIDAR_NS)
        for row, reach_m in ((0, 0.05 * math.sqrt(2) + 0.01), (1, 0.15 * math.sqrt(2) + 0.15)):
            places_m = POLES.found_m(grids.grids[row, frame])
            told[row] += len(places_m)
            assert (POLES.away_m(places_m, pose) < reach_m).all()
        both = POLES.found_m(grids.grids[2, frame])
        assert (POLES.away_m(both, pose) < 0.15 * math.sqrt(2) + 0.15).all()
    assert min(told) > 60

    text = bag.map_text()
    (tmp_path / "bent").mkdir()
    bent, _ = converted(tmp_path / "bent", messages, text, storage)
    wrong = built(bent, ("top", "front"), **sensors)
    off_m = [
        POLES.away_m(POLES.found_m(wrong.grids[0, frame]), DRIVE.pose_at(frame * LIDAR_NS)).max()
        for frame in range(1, 9)
    ]
    assert min(off_m) > 0.9, "in 0.09 s the vehicle drives 1.1 m"


def stamp_of(sent):
    stamp = sent.message.header.stamp
    return stamp.sec * 10**9 + stamp.nanosec


CODINGS = {
    "float32": Coding(),
    "float64": Coding("f8"),
    "organised, rows padded": Coding(rows=4, padding=6),
    "big-endian": Coding(big=True, labels="i4"),
}


@pytest.mark.parametrize("name", CODINGS)
def test_clouds_of_any_coding_give_the_sweeps_that_they_were_made_of(tmp_path, name):
    recording = scanned(DRIVE, range(0, 5 * LIDAR_NS, LIDAR_NS), PLACES)
    bag = RigBag(recording, CODINGS[name])
    log, _ = converted(tmp_path, bag.messages(), bag.map_text())
    with LogReader(log) as reader:
        found = list(reader.sweeps("top"))
    for sweep, moment in zip(found, recording.moments(), strict=True):
        expected = moment.sweeps["top"]
        assert sweep.stamp_ns == expected.stamp_ns
        assert np.array_equal(sweep.points_m, expected.points_m)
        assert np.array_equal(sweep.intensity, expected.intensity)
        assert np.array_equal(sweep.label_id, expected.label_id)
        assert np.allclose(sweep.mount.place_m, expected.mount.place_m)
        assert np.allclose(sweep.mount.turn, expected.mount.turn)


@pytest.mark.parametrize(
    ("unit", "last", "told"),
    [
        ("us", 90, "a cloud of top takes 0.09 ms by its t and one comes every 100 ms: is its unit ms, not us?"),
        ("s", 0.0, "times of points are all the same in each cloud of top (its t): they count as of one time"),
        ("ms", 90, ""),
        ("us", 1000, ""),  # a flash of 1 ms
        ("s", 0.9, ""),  # clouds that were thinned out, or a wrong clock: no unit is better
    ],
)
def test_times_of_points_that_are_odd_are_warned_of_in_a_line_of_their_own(tmp_path, unit, last, told):
    bag = RigBag(scanned(DRIVE, range(0, 3 * LIDAR_NS, LIDAR_NS), PLACES))
    messages = []
    for each in bag.messages():
        if each.topic == "/top/points":
            points = np.ones(len(PLACES), [(name, "f4") for name in ("x", "y", "z", "t")] + [("label", "u2")])
            points["t"] = np.linspace(0, last, len(PLACES))
            each = each._replace(message=ros.cloud(stamp_of(each), points, frame="top"))
        messages.append(each)
    write_bag(tmp_path / "drive", messages)
    (tmp_path / "map.yaml").write_text(bag.map_text(f"times: {{field: t, unit: {unit}}}"))
    ended = run_command(f"convert ros2 {tmp_path}/drive {tmp_path}/logs --map {tmp_path}/map.yaml --workers 1".split())
    warned = [line.removeprefix("Warning: ") for line in ended.err.splitlines() if "Warning" in line]
    assert (ended.code, warned) == (0, [told] if told else [])
    assert "3 of 3 frames and sweeps; no frame left out" in ended.err.splitlines()


def test_a_cloud_without_points_and_fields_between_others_is_an_empty_sweep(tmp_path):
    bag = RigBag(scanned(DRIVE, range(0, 3 * LIDAR_NS, LIDAR_NS), PLACES))
    messages = list(bag.messages())
    second = [place for place, sent in enumerate(messages) if sent.topic == "/top/points"][1]
    messages[second] = messages[second]._replace(message=ros.no_cloud(stamp_of(messages[second]), frame="top"))
    log, _ = converted(tmp_path, messages, bag.map_text())
    with LogReader(log) as reader:
        assert [len(sweep.points_m) for sweep in reader.sweeps("top")] == [len(PLACES), 0, len(PLACES)]


def test_sweeps_without_labels_come_into_the_log_and_what_is_missing_is_said(tmp_path):
    bag = RigBag(scanned(DRIVE, range(0, 3 * LIDAR_NS, LIDAR_NS), PLACES), Coding(labels=""))
    log, summary = converted(tmp_path, bag.messages(), bag.map_text())
    assert summary.remark == (
        "3 of 3 frames and sweeps; no frame left out; points of top have no labels: a grid needs `label_field` in the "
        "map, or a camera to colour them: `colour_from` of the sensor"
    )
    with LogReader(log) as reader:
        assert [sweep.label_id for sweep in reader.sweeps("top")] == [None] * 3


def test_two_lidars_keep_their_mounts(tmp_path):
    low = Mount((3.5, -0.8, 0.6), (0.0, 0.0, math.sin(-0.4), math.cos(-0.4)))

    def moments():
        for since in range(0, 3 * LIDAR_NS, LIDAR_NS):
            stamp_ns, pose = START_NS + since, DRIVE.pose_at(since)
            sweeps = {"top": seen(stamp_ns, pose, PLACES), "low": seen(stamp_ns, pose, PLACES, mount=low)}
            yield Moment(stamp_ns, {}, tuple(motion([since])), sweeps=sweeps)

    bag = RigBag(recorded(moments))
    log, _ = converted(tmp_path, bag.messages(), bag.map_text())
    with LogReader(log) as reader:
        assert reader.lidars == ("low", "top")
    grids = built(log, ("top",), top=LidarSensor(lidar="top"), low=LidarSensor(lidar="low"))
    assert (grids.grids[0] == POLE).sum() > 20
    np.testing.assert_array_equal(grids.grids[0], grids.grids[1])


def test_a_sequence_of_semantickitti_as_a_bag_gives_the_grids_of_its_files(tmp_path):
    rng = np.random.default_rng(3)
    points = tuple(map(tuple, rng.uniform((-40, -40, -2), (40, 40, 2), (3000, 3)).tolist()))
    labels = tuple((rng.choice([40, 48, 50, 70, 252, 30, 99], 3000) | rng.integers(0, 9, 3000) << 16).tolist())
    Sequence(frames=5, points=points, labels=labels, yaw_rate_radps=0.3).write(tmp_path / "src")
    convert_kitti(KittiOptions(src=tmp_path / "src"), tmp_path / "kitti")
    (expected,) = find_logs(tmp_path / "kitti")
    recording = read_recording(expected)
    raw = {moment.stamp_ns: np.array(labels, np.uint32) for moment in recording.moments()}
    bag = RigBag(recording, Coding(labels="u4"), raw)
    log, _ = converted(tmp_path, bag.messages(), bag.map_text(ids="semantickitti"))
    config = GridConfig(sensors={"top": LidarSensor()}, target=("top",))
    (ours,), (theirs,) = (build_log(each, config) for each in (log, expected))
    assert (theirs.grids != UNKNOWN).mean() > 0.05
    np.testing.assert_array_equal(ours.grids, theirs.grids)
    np.testing.assert_array_equal(ours.stamps_ns, theirs.stamps_ns)


def test_a_log_of_a_bag_is_the_same_again_until_its_clouds_change(tmp_path):
    bag = RigBag(scanned(DRIVE, range(0, 3 * LIDAR_NS, LIDAR_NS), PLACES))
    converted(tmp_path, bag.messages(), bag.map_text())
    options = Ros2Options(bag=(tmp_path / "drive",), map=str(tmp_path / "map.yaml"))
    assert convert_bags(options, tmp_path / "logs").skipped == ["val/drive_000000"]
    messages = list(bag.messages())
    last = next(each for each in reversed(messages) if each.topic == "/top/points")
    last.message.data[0] ^= 1
    write_bag(tmp_path / "b" / "drive", messages)
    changed = Ros2Options(bag=(tmp_path / "b" / "drive",), map=str(tmp_path / "map.yaml"))
    assert convert_bags(changed, tmp_path / "logs").written == ["val/drive_000000"]


def test_written_again_the_log_is_the_same_bytes(tmp_path):
    bag = RigBag(scanned(DRIVE, range(0, 3 * LIDAR_NS, LIDAR_NS), PLACES))
    log, _ = converted(tmp_path, bag.messages(), bag.map_text())
    write_log(read_recording(log), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == log.read_bytes()
