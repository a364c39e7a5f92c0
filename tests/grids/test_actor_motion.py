"""Whom cells show and how far they move: against the true boxes, and against pictures that can be checked by hand."""

import numpy as np
import pytest
from support.towns import small_plans
from support.toy_world import street

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import UnknownTruthError
from semgrid_eval.grids.actor_motion import ActorMotion
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import MOVING, GridConfig
from semgrid_eval.grids.truth import WindowTimes
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.sources.town.rendering import render_recording

CONFIG = GridConfig()
SENSORS = ("full", "split1_lower")
STATIC = [CLASS_NAMES.index(name) for name in ("unknown", "road", "sidewalk", "building", "vegetation", "pole_sign")]
INPUT, TARGET = 10, 25


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Logs of exact pictures with the frames' grids and the motion from frame 10 to frame 25."""
    folder, found = tmp_path_factory.mktemp("town"), []
    for plan in small_plans(stereo="exact", width=256, height=128)[2:]:
        path = folder / f"{plan.name}.mcap"
        write_log(render_recording(plan), path)
        recording = build_log(path, CONFIG)[0]
        stamps_ns = recording.stamps_ns
        asked = WindowTimes(stamps_ns[:1], stamps_ns[[[INPUT]]], stamps_ns[[TARGET]])
        with LogReader(path) as log:
            motion_m = ActorMotion(SENSORS).find(log, CONFIG, asked)
            everybody = {stamp: {a.actor_id: a for a in actors} for stamp, actors in log.actors()}
        found.append((recording, motion_m[0, :, 0].astype(float), [everybody[stamps_ns[i]] for i in (INPUT, TARGET)]))
    return found


def test_only_cells_of_what_can_move_do(seen):
    for recording, motion_m, _ in seen:
        for at, sensor in enumerate(SENSORS):
            grid = recording.grids[recording.sensors.index(sensor), INPUT]
            assert not motion_m[at][np.isin(grid, STATIC)].any()
    assert any(motion_m[0].any() for _, motion_m, _ in seen)


def test_cells_move_as_far_as_one_of_those_who_truly_do(seen):
    for recording, motion_m, (before, after) in seen:
        moved = np.hypot(*motion_m[0].transpose(2, 0, 1))
        ways_m = np.array(
            [np.hypot(after[i].x_m - a.x_m, after[i].y_m - a.y_m) for i, a in before.items() if i in after]
        )
        turns = [abs(after[i].yaw_rad - a.yaw_rad) * a.length_m for i, a in before.items() if i in after]
        for way_m in moved[moved > 0.05]:
            assert np.abs(ways_m - way_m).min() < 0.2 + max(turns)
        fast = moved > 2.0
        assert (recording.actors[INPUT][fast] & MOVING).astype(bool).sum() >= 0.9 * fast.sum()


def test_moved_cells_lie_where_the_actor_is_at_the_target(seen):
    """Centres of cells, moved by the ego motion and their own, come to lie near moving actors there."""
    hits, total = 0, 0
    for recording, motion_m, _ in seen:
        rows, columns = np.nonzero(np.hypot(*motion_m[0].transpose(2, 0, 1)) > 2.0)
        ego_m = recording.position_m[TARGET] - recording.position_m[INPUT]
        way_m = motion_m[0][rows, columns] - ego_m
        there = np.stack([rows, columns], axis=-1) - np.rint(way_m / CONFIG.spec.cell_m).astype(int)
        inside = ((there >= 0) & (there < 128)).all(axis=1)
        flags = recording.actors[TARGET][tuple(there[inside].T)]
        hits, total = hits + int((flags & MOVING > 0).sum()), total + int(inside.sum())
    assert total > 0
    assert hits / total > 0.9


def test_a_log_that_does_not_tell_whom_pixels_show_says_so(tmp_path):
    path = tmp_path / "toy.mcap"
    write_log(street(frames=9).recording(), path)
    stamps_ns = build_log(path, CONFIG)[0].stamps_ns
    asked = WindowTimes(stamps_ns[:1], stamps_ns[[[2]]], stamps_ns[[8]])
    with LogReader(path) as log, pytest.raises(UnknownTruthError, match="which pixels show whom"):
        ActorMotion(("full",)).find(log, CONFIG, asked)
