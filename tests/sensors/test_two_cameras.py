"""Two cameras that look different ways at different times: their points land where things stand in the world."""

import math

import numpy as np
import pytest
from support.toy_world import FRAME_NS, START_NS, Box, Mount, ToyWorld

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.log.store import write_log
from semgrid_eval.sensors.camera import CameraSensor

POLE = CLASS_NAMES.index("pole_sign")
SPEC = GridSpec(rows=400, columns=400, cell_m=0.1, agent_row=300, agent_column=250)
LATE_NS = 40_000_000
POLES = [Box("pole", x, x + 0.3, 9.0, 9.3, 3.0) for x in range(2, 30, 3)]


def built(folder, *, target=("front",), max_age_s=0.2):
    cameras = {"front": Mount(), "left": Mount(1.3, LATE_NS)}
    world = ToyWorld(POLES, speed_mps=14.0, yaw_rate_radps=0.7, frames=8, cameras=cameras)
    write_log(world.recording(), folder / "toy.mcap")
    sensors = {name: CameraSensor(camera=name, max_age_s=max_age_s) for name in cameras}
    config = GridConfig(spec=SPEC, sensors=sensors, target=target, integrator="arc", morphology="off")
    (recording,) = build_log(folder / "toy.mcap", config)
    return world, recording


def pole_places_m(grid):
    """World places of the cells of poles against the vehicle; the grid has the orientation of the first frame, 0."""
    cells = np.argwhere(grid == POLE)
    return (np.array([SPEC.agent_row, SPEC.agent_column]) - 0.5 - cells) * SPEC.cell_m


@pytest.mark.parametrize(("row", "name"), [(0, "front"), (1, "left")])
def test_poles_stand_where_they_are_at_the_time_of_the_grid(tmp_path, row, name):
    world, recording = built(tmp_path)
    assert recording.sensors[row] == name
    np.testing.assert_array_equal(recording.stamps_ns, START_NS + np.arange(8) * FRAME_NS)
    found = 0
    for frame in range(1, 8):
        x_m, y_m, yaw_rad = world.pose_at(frame * FRAME_NS)
        assert recording.yaw_rad[frame] == pytest.approx(yaw_rad)
        places_m = np.add(pole_places_m(recording.grids[row, frame]), (x_m, y_m))
        found += len(places_m)
        for place_m in places_m:
            away_m = min(math.hypot(*(place_m - ((pole.x0 + pole.x1) / 2, 9.15))) for pole in POLES)
            assert away_m < 0.15 * math.sqrt(2) + 0.15, "half a pole, half a cell and what a pixel can tell"
    assert found > 50


def test_both_cameras_see_their_side_and_the_first_time_has_no_picture_of_the_late_one(tmp_path):
    _, recording = built(tmp_path)
    front, left = recording.grids != UNKNOWN
    assert not left[0].any()
    assert left[1:].any(axis=(1, 2)).all()
    assert front[:, :, :100].sum() < left[:, :, :100].sum()


def test_a_picture_that_is_too_old_is_left_out(tmp_path):
    age_s = (FRAME_NS - LATE_NS) * 1e-9
    assert (built(tmp_path, max_age_s=age_s + 1e-4)[1].grids[1] != UNKNOWN).any()
    assert not (built(tmp_path, max_age_s=age_s - 1e-4)[1].grids[1] != UNKNOWN).any()


def test_a_target_of_both_holds_what_either_sees(tmp_path):
    _, recording = built(tmp_path, target=("front", "left"))
    assert recording.sensors == ("front", "left", "front+left")
    assert recording.target == "front+left"
    front, left, both = recording.grids != UNKNOWN
    np.testing.assert_array_equal(both, front | left)


def test_the_first_sensor_of_the_target_leads(tmp_path):
    world, recording = built(tmp_path, target=("left", "front"))
    np.testing.assert_array_equal(recording.stamps_ns, START_NS + LATE_NS + np.arange(8) * FRAME_NS)
    start_rad = world.pose_at(LATE_NS)[2]
    assert recording.yaw_rad == pytest.approx([world.pose_at(LATE_NS + k * FRAME_NS)[2] - start_rad for k in range(8)])
