"""Argoverse's layout: what comes into logs, what is refused, in a line that names file and row."""

import json
import math

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra `argoverse` is not installed")

from support.argoverse_log import (
    CAR_MPS,
    EGO_MPS,
    FRAMES,
    START_NS,
    STEP_NS,
    YAW_RAD,
    columns,
    ego,
    pose_columns,
    write_argoverse,
    write_table,
)

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN
from semgrid_eval.errors import InputError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import MOVING, STANDING, GridConfig
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.sensors.tracks import TracksSensor
from semgrid_eval.sources.argoverse2.categories import CATEGORIES
from semgrid_eval.sources.argoverse2.convert import ArgoverseOptions, convert_argoverse

STAMPS_NS = [START_NS + number * STEP_NS for number in range(FRAMES)]


def converted(root, **options):
    summary = convert_argoverse(ArgoverseOptions(src=root / "src", **options), root / "logs")
    assert summary.failed == {}
    return summary


@pytest.fixture
def log(tmp_path):
    write_argoverse(tmp_path / "src", sweeps=True)
    converted(tmp_path)
    return tmp_path / "logs" / "val" / "drive.mcap"


def test_motion_and_poses_are_those_of_the_vehicle_in_the_city(log):
    assert check_log(log).findings == ()
    with LogReader(log) as reader:
        assert (reader.scene.dataset, reader.scene.group, reader.scene.cameras) == ("argoverse2", "PIT", ())
        samples, poses = reader.motion(), reader.poses()
    assert [each.stamp_ns for each in samples] == STAMPS_NS
    assert [each.speed_mps for each in samples] == pytest.approx([EGO_MPS] * FRAMES)
    assert [each.yaw_rate_radps for each in samples] == pytest.approx([0.0] * FRAMES, abs=1e-9)
    for number, pose in enumerate(poses):
        assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((*ego(number), YAW_RAD))


def test_actors_stand_in_the_city_with_class_and_velocity(log):
    with LogReader(log) as reader:
        moments = list(reader.actors())
    assert [stamp_ns for stamp_ns, _ in moments] == STAMPS_NS
    for number, (_, actors) in enumerate(moments):
        car, parked, walker, hidden = actors
        assert [each.actor_id for each in actors] == [1, 2, 3, 4]
        assert [each.label_id for each in actors] == [LABEL_ID[name] for name in ("car", "car", "person", "unlabeled")]
        x_m, y_m = ego(number)
        ahead_m = 20.0 + (CAR_MPS - EGO_MPS) * number * STEP_NS * 1e-9
        place_m = x_m + ahead_m * math.cos(YAW_RAD), y_m + ahead_m * math.sin(YAW_RAD)
        assert (car.x_m, car.y_m, car.yaw_rad) == pytest.approx((*place_m, YAW_RAD))
        velocity = CAR_MPS * math.cos(YAW_RAD), CAR_MPS * math.sin(YAW_RAD)
        assert (car.velocity_x_mps, car.velocity_y_mps) == pytest.approx(velocity)
        for still in (parked, walker):
            assert math.hypot(still.velocity_x_mps, still.velocity_y_mps) == pytest.approx(0.0, abs=1e-6)
        assert math.hypot(hidden.velocity_x_mps, hidden.velocity_y_mps) == pytest.approx(EGO_MPS)


def test_velocity_stays_zero_where_a_track_has_one_box_and_does_not_reach_over_a_gap(tmp_path):
    folder = write_argoverse(tmp_path / "src")
    content = columns()
    keep = [
        row
        for row, track in enumerate(content["track_uuid"])
        if not (track == "a-car" and 0 < row // 4 < 5) and not (track == "b-parked" and row // 4)
    ]
    write_table(folder / "annotations.feather", {name: [each[row] for row in keep] for name, each in content.items()})
    converted(tmp_path)
    with LogReader(tmp_path / "logs" / "val" / "drive.mcap") as reader:
        (_, first), *_ = reader.actors()
    assert [(each.velocity_x_mps, each.velocity_y_mps) for each in first[:2]] == [(0.0, 0.0)] * 2


def test_sweeps_come_along_without_labels_and_everything_comes_back(log, tmp_path):
    with LogReader(log) as reader:
        (sweep,) = reader.sweeps("top")
        assert reader.road_map().drivable[0][2] == (5200.0, 2600.0)
        assert reader.road_map().crossings == (
            ((5010.0, 2400.0), (5020.0, 2400.0), (5020.0, 2404.0), (5010.0, 2404.0)),
        )
    assert (sweep.stamp_ns, sweep.label_id) == (STAMPS_NS[1], None)
    assert sweep.points_m.tolist() == [[1.5, 0.25, 0.0], [-2.0, 3.0, 1.0]]
    assert sweep.intensity.tolist() == [3.0, 200.0]
    write_log(read_recording(log), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == log.read_bytes()


@pytest.mark.slow
def test_grids_show_who_was_seen_and_who_moves(log):
    (recording,) = build_log(log, GridConfig(sensors={"tracks": TracksSensor()}, target=("tracks",)))
    car, person, road = (CLASS_NAMES.index(name) for name in ("car", "person", "road"))
    grid, actors = recording.grids[0, 0], recording.actors[0]
    row = lambda ahead_m: 127 - int(ahead_m / (100 / 128))  # noqa: E731
    assert (grid[row(20.0), 64], grid[row(15.0), 56], grid[row(40.0), 64]) == (car, person, road)
    assert grid[row(50.0), 64] == UNKNOWN, "nothing was seen of the bus"
    assert (actors[row(20.0), 64], actors[row(30.0), 69]) == (MOVING, STANDING)


def test_splits_can_be_chosen_and_what_has_not_changed_stays(tmp_path):
    write_argoverse(tmp_path / "src", "one", "train")
    write_argoverse(tmp_path / "src", "two", "val")
    assert converted(tmp_path, split=("val",)).written == ["val/two"]
    again = converted(tmp_path)
    assert (again.written, again.skipped) == (["train/one"], ["val/two"])
    with pytest.raises(InputError, match=r"src: split: test is not one of: train, val$"):
        convert_argoverse(ArgoverseOptions(src=tmp_path / "src", split=("test",)), tmp_path / "logs")


def test_a_folder_without_logs_is_told(tmp_path):
    (tmp_path / "src" / "val").mkdir(parents=True)
    with pytest.raises(InputError, match=r"src: holds no log in a folder val$"):
        convert_argoverse(ArgoverseOptions(src=tmp_path / "src"), tmp_path / "logs")


def test_every_category_has_a_label():
    assert len(CATEGORIES) == 30
    assert set(CATEGORIES.values()) <= LABEL_ID.keys()


def with_value(name, value, row=5):
    def damage(folder):
        content = columns()
        content[name][row] = value
        write_table(folder / "annotations.feather", content)

    return damage


def without_column(folder):
    content = columns()
    del content["category"]
    write_table(folder / "annotations.feather", content)


def without_a_pose(folder):
    kept = {name: each[:4] + each[5:] for name, each in pose_columns().items()}
    write_table(folder / "city_SE3_egovehicle.feather", kept)


def with_map(text):
    def damage(folder):
        (path,) = (folder / "map").iterdir()
        path.write_text(text)

    return damage


ARCHIVE = "map/log_map_archive_drive____PIT_city_1.json"
FAULTS = {
    "nan place": (with_value("tx_m", math.nan), "annotations.feather: tx_m: row 5: nan is not finite"),
    "nan size": (with_value("length_m", math.nan), "annotations.feather: length_m: row 5: nan is not finite"),
    "endless": (with_value("width_m", math.inf), "annotations.feather: width_m: row 5: inf is not finite"),
    "flat": (with_value("width_m", 0.0), "annotations.feather: width_m: row 5: 0 m is not within 0 to 200 m"),
    "category": (
        with_value("category", "TANK"),
        "annotations.feather: category: row 5: 'TANK' is not one of Argoverse's",
    ),
    "nothing": (with_value("category", None), "annotations.feather: category: holds no value in some row"),
    "time": (with_value("timestamp_ns", -1), "annotations.feather: timestamp_ns: row 5: -1 ns is not a time"),
    "no turn": (with_value("qw", 0.0), "annotations.feather: qw, qx, qy, qz: row 5: (0, 0, 0, 0) is not a rotation"),
    "column": (without_column, "annotations.feather: category: is missing"),
    "pose": (
        without_a_pose,
        f"city_SE3_egovehicle.feather: has no pose at {STAMPS_NS[2]} ns, where there are boxes",
    ),
    "no poses": (lambda f: (f / "city_SE3_egovehicle.feather").unlink(), "city_SE3_egovehicle.feather: is missing"),
    "no boxes": (lambda f: (f / "annotations.feather").unlink(), "annotations.feather: is missing"),
    "no map": (
        lambda f: (f / ARCHIVE).unlink(),
        "map: holds 0 files log_map_archive_*.json; one is needed",
    ),
    "empty map": (with_map("{}"), f"{ARCHIVE}: is not a map of Argoverse: KeyError 'drivable_areas'"),
    "map of lists": (with_map("[]"), f"{ARCHIVE}: is not a map of Argoverse: TypeError ..."),
    "far": (
        with_map(
            json.dumps(
                {
                    "drivable_areas": {"1": {"area_boundary": [{"x": 1e300, "y": 0}] * 3}},
                    "pedestrian_crossings": {},
                }
            )
        ),
        f"{ARCHIVE}: a corner of a map is at [1e+300, 0]",
    ),
    "no feather": (
        lambda f: (f / "annotations.feather").write_bytes(b"no"),
        "annotations.feather: is not a feather file: ...",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_fails_its_log_alone_in_a_line(tmp_path, name):
    damage, line = FAULTS[name]
    folder = write_argoverse(tmp_path / "src")
    write_argoverse(tmp_path / "src", "other")
    damage(folder)
    summary = convert_argoverse(ArgoverseOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert summary.written == ["val/other"]
    assert [path.stem for path in find_logs(tmp_path / "logs")] == ["other"]
    (found,) = summary.failed.values()
    expected = f"{folder}/{line}"
    assert "\n" not in found
    assert found.startswith(expected[:-3]) if expected.endswith("...") else found == expected


def test_a_sweep_that_is_not_finite_fails_its_log(tmp_path):
    folder = write_argoverse(tmp_path / "src", sweeps=True)
    (path,) = (folder / "sensors" / "lidar").iterdir()
    write_table(path, {"x": [np.nan], "y": [0.0], "z": [0.0], "intensity": [1]})
    summary = convert_argoverse(ArgoverseOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert list(summary.failed.values()) == [f"{path}: x: row 0: nan is not finite"]
