"""Boxes and maps in grids: which cells are known, of what class, and where."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from support.swept import START_NS, recorded

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, LogError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.check import check_log
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.road_map import FILE, RoadMap
from semgrid_eval.recording.types import Actor, Moment, MotionSample, Pose
from semgrid_eval.sensors.tracks import TracksSensor
from semgrid_eval.windows.grids import shift_grids, shift_in_cells

ROAD, CAR, PERSON = (CLASS_NAMES.index(name) for name in ("road", "car", "person"))
SPEC = GridSpec(rows=100, columns=100, cell_m=0.5, agent_row=90, agent_column=50)
STEP_NS = 100_000_000
HERE = Pose(START_NS, 1000.0, -500.0, 0.7)
EVERYWHERE = ((800.0, -700.0), (1200.0, -700.0), (1200.0, -300.0), (800.0, -300.0))


def to_map(ahead_m, left_m, pose=HERE):
    """A place in the map from one in the vehicle frame."""
    cosine, sine = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return pose.x_m + cosine * ahead_m - sine * left_m, pose.y_m + sine * ahead_m + cosine * left_m


def box(ahead_m, left_m, label="car", *, turn=0.0, size=(4.0, 2.0), actor_id=1):
    x_m, y_m = to_map(ahead_m, left_m)
    return Actor(actor_id, LABEL_ID[label], x_m, y_m, HERE.yaw_rad + turn, *size, 1.5, 0.0, 0.0)


def grids_of(folder, *times, road_map=None, sensor=None):
    """Grids of actors at times STEP_NS apart, seen by a vehicle that drives ahead at 5 m/s."""

    def moments():
        for number, actors in enumerate(times):
            stamp_ns = START_NS + number * STEP_NS
            x_m, y_m = to_map(0.5 * number, 0.0)
            pose = Pose(stamp_ns, x_m, y_m, HERE.yaw_rad)
            yield Moment(stamp_ns, {}, (MotionSample(stamp_ns, 5.0, 0.0),), pose, tuple(actors))

    files = {} if road_map is None else {FILE: road_map.to_json()}
    write_log(replace(recorded(moments), source_files=files), folder / "log.mcap")
    sensors = {"tracks": sensor or TracksSensor(range_m=60.0)}
    config = GridConfig(spec=SPEC, sensors=sensors, target=("tracks",))
    (recording,) = build_log(folder / "log.mcap", config)
    return recording.grids[0]


def cell(ahead_m, left_m):
    return SPEC.agent_row - 1 - math.floor(ahead_m / SPEC.cell_m), SPEC.agent_column - 1 - math.floor(
        left_m / SPEC.cell_m
    )


def test_a_box_fills_the_cells_that_it_covers_and_nothing_else_is_known(tmp_path):
    (grid,) = grids_of(tmp_path, [box(12.0, 3.0)])
    forward_m, left_m = SPEC.centres_m()
    covered = (np.abs(forward_m[:, None] - 12.0) < 2.0) & (np.abs(left_m - 3.0) < 1.0)
    np.testing.assert_array_equal(grid == CAR, covered)
    np.testing.assert_array_equal(grid != UNKNOWN, covered)


def test_a_turned_box_lies_as_it_is_turned(tmp_path):
    (grid,) = grids_of(tmp_path, [box(12.0, 3.0, turn=math.pi / 2, size=(6.0, 1.0))])
    forward_m, left_m = SPEC.centres_m()
    np.testing.assert_array_equal(grid == CAR, (np.abs(forward_m[:, None] - 12.0) < 0.5) & (np.abs(left_m - 3.0) < 3.0))


def test_what_stands_moves_towards_the_vehicle_and_a_small_box_is_never_lost(tmp_path):
    grids = grids_of(tmp_path, *[[box(12.3, 3.3, "person", size=(0.05, 0.05))]] * 4)
    for number, grid in enumerate(grids):
        assert np.argwhere(grid == PERSON).tolist() == [list(cell(12.3 - 0.5 * number, 3.3))]


def test_drivable_area_and_crossings_are_road_and_the_rest_is_unknown(tmp_path):
    lane = tuple(to_map(*corner) for corner in ((0, -2), (30, -2), (30, 2), (0, 2)))
    zebra = tuple(to_map(*corner) for corner in ((10, 2), (14, 2), (14, 6), (10, 6)))
    (grid,) = grids_of(tmp_path, [box(20.0, 0.0)], road_map=RoadMap((lane,), (zebra,)))
    assert (grid[cell(5.2, 0.2)], grid[cell(12.2, 4.2)], grid[cell(20.2, 0.2)]) == (ROAD, ROAD, CAR)
    assert (grid[cell(8.2, 4.2)], grid[cell(32.2, 0.2)], grid[cell(-3.2, 0.2)]) == (UNKNOWN,) * 3
    assert np.count_nonzero(grid == ROAD) == (30 * 4 + 4 * 4 - 4 * 2) / 0.25


def test_polygons_that_overlap_do_not_cancel_each_other(tmp_path):
    (grid,) = grids_of(tmp_path, [], road_map=RoadMap((EVERYWHERE, EVERYWHERE), (EVERYWHERE,)))
    assert (grid == ROAD).all()


@pytest.mark.parametrize("label", ["unlabeled", "static", "dynamic"])
def test_beneath_a_box_of_which_nothing_was_seen_or_that_has_no_class_the_ground_is_unknown(tmp_path, label):
    (grid,) = grids_of(tmp_path, [box(12.0, 3.0, label)], road_map=RoadMap((EVERYWHERE,), ()))
    forward_m, left_m = SPEC.centres_m()
    inside = (np.abs(forward_m[:, None] - 12.0) < 1.9) & (np.abs(left_m - 3.0) < 0.9)
    assert (grid[inside] == UNKNOWN).all()
    assert (grid[~((np.abs(forward_m[:, None] - 12.0) < 2.6) & (np.abs(left_m - 3.0) < 1.6))] == ROAD).all()


def test_ground_ends_at_the_range(tmp_path):
    (grid,) = grids_of(tmp_path, [], road_map=RoadMap((EVERYWHERE,), ()), sensor=TracksSensor(range_m=10.0))
    forward_m, left_m = SPEC.centres_m()
    np.testing.assert_array_equal(grid == ROAD, (np.abs(forward_m[:, None]) < 10.0) & (np.abs(left_m) < 10.0))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"x_m": math.nan}, "actor 1: is not at a finite place"),
        ({"length_m": math.nan}, "actor 1: is nan x 2 m; 0 to 200 m are allowed"),
        ({"width_m": -1.0}, "actor 1: is 4 x -1 m; 0 to 200 m are allowed"),
        ({"length_m": 1e9}, r"actor 1: is 1e\+09 x 2 m; 0 to 200 m are allowed"),
        ({"velocity_x_mps": math.inf}, "actor 1: has a height or velocity that is not finite"),
        ({"label_id": 300}, "actor 1: has label 300"),
    ],
)
def test_an_impossible_box_is_refused_in_a_line(tmp_path, change, line):
    with pytest.raises(LogError, match=rf"log\.mcap: /truth/actors at {START_NS} ns: {line}$"):
        grids_of(tmp_path, [replace(box(12.0, 3.0), **change)])


def test_a_log_without_poses_or_with_a_broken_map_is_refused_in_a_line(tmp_path):
    moment = Moment(START_NS, {}, (MotionSample(START_NS, 0.0, 0.0),), None, (box(12.0, 3.0),))
    config = GridConfig(sensors={"tracks": TracksSensor()}, target=("tracks",))
    write_log(recorded(lambda: iter([moment])), tmp_path / "log.mcap")
    with pytest.raises(LogError, match=rf"log\.mcap: has no true pose at {START_NS} ns$"):
        build_log(tmp_path / "log.mcap", config)
    write_log(replace(recorded(lambda: iter([moment])), source_files={FILE: b"[]"}), tmp_path / "log.mcap")
    with pytest.raises(LogError, match=r"log\.mcap: is damaged: a map has the keys drivable and crossings$"):
        build_log(tmp_path / "log.mcap", config)


def test_ground_has_a_bound():
    with pytest.raises(ConfigError, match=r"range_m 400 is more than 2500 times spacing_m 0\.1"):
        parse_config(TracksSensor, {"range_m": 400, "spacing_m": 0.1})


def test_a_broken_map_is_found_by_a_check(tmp_path):
    moment = Moment(START_NS, {}, (MotionSample(START_NS, 0.0, 0.0),), None, (box(12.0, 3.0),))
    write_log(replace(recorded(lambda: iter([moment])), source_files={FILE: b"{}"}), tmp_path / "log.mcap")
    (fault,) = [each for each in check_log(tmp_path / "log.mcap").findings if each.place == "file"]
    assert fault.message == "is damaged: a map has the keys drivable and crossings"


def test_a_log_without_actors_gives_no_grid(tmp_path):
    moment = Moment(START_NS, {}, (MotionSample(START_NS, 0.0, 0.0),))
    write_log(recorded(lambda: iter([moment])), tmp_path / "log.mcap")
    with pytest.raises(LogError, match=r"log\.mcap: sensor tracks has no frames$"):
        build_log(tmp_path / "log.mcap", GridConfig(sensors={"tracks": TracksSensor()}, target=("tracks",)))


def test_motion_of_the_wrong_sign_is_worse_than_none_and_the_right_one_is_best(tmp_path):
    standing = [box(ahead_m, left_m, actor_id=k) for k, (ahead_m, left_m) in enumerate([(30, 5), (20, -6), (12, 2)], 1)]
    grids = torch.from_numpy(grids_of(tmp_path, *[standing] * 7))
    way_m = np.array([0.5 * 6, 0.0])
    share = {}
    for sign in (1, 0, -1):
        moved = shift_grids(grids[0], torch.from_numpy(shift_in_cells(sign * way_m, SPEC.cell_m)))
        both = (moved == CAR) & (grids[6] == CAR)
        share[sign] = float(both.sum() / ((moved == CAR) | (grids[6] == CAR)).sum())
    assert share[1] == 1.0
    assert share[1] > share[0] > share[-1]
