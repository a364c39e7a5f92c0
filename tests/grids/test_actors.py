"""Footprints of true actors: against a point-in-box loop, by hand, and in the place where a sensor sees them."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from support.toy_world import FRAME_NS, Box, ToyWorld, street

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import LogError
from semgrid_eval.grids.actors import MARGIN_M, MOVING_FROM_MPS, boxes_in_grid, draw_boxes
from semgrid_eval.grids.build import build_grids, build_log
from semgrid_eval.grids.spec import MOVING, STANDING, GridConfig, GridSpec
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.types import Actor, Pose

CAR = CLASS_NAMES.index("car")
SPEC = GridSpec(rows=24, columns=20, cell_m=0.5, agent_row=20, agent_column=11)
FULL = GridSpec()


def actor(x_m, y_m, yaw_rad=0.0, length_m=4.0, width_m=2.0, speed_mps=0.0):
    return Actor(7, LABEL_ID["car"], x_m, y_m, yaw_rad, length_m, width_m, 1.5, speed_mps, 0.0)


def slow_signed_m(who, pose, yaw_rad, spec, row, column):
    """How far inside (positive) the grown box of an actor the middle of a cell lies, walking through the frames."""
    forward_m = (spec.agent_row - row - 0.5) * spec.cell_m
    left_m = (spec.agent_column - column - 0.5) * spec.cell_m
    vehicle = complex(forward_m, left_m) * np.exp(-1j * yaw_rad)  # out of the grid's orientation
    place = complex(pose.x_m, pose.y_m) + vehicle * np.exp(1j * pose.yaw_rad)
    inside = (place - complex(who.x_m, who.y_m)) * np.exp(-1j * who.yaw_rad)
    return min(who.length_m / 2 + MARGIN_M - abs(inside.real), who.width_m / 2 + MARGIN_M - abs(inside.imag))


ANGLES = st.floats(-7, 7)
ACTORS = st.builds(
    actor,
    x_m=st.floats(-15, 15),
    y_m=st.floats(-15, 15),
    yaw_rad=ANGLES,
    length_m=st.floats(0.1, 12),
    width_m=st.floats(0.1, 3),
    speed_mps=st.sampled_from([0.0, MOVING_FROM_MPS - 1e-6, MOVING_FROM_MPS, -3.0]),
)


@settings(max_examples=60)
@given(st.lists(ACTORS, max_size=3), st.builds(Pose, st.just(0), st.floats(-9, 9), st.floats(-9, 9), ANGLES), ANGLES)
@example([actor(1e6, 0.0), actor(0.0, -1e300)], Pose(0, 0.0, 0.0, 0.3), 0.1)
def test_footprints_equal_a_point_in_box_loop(actors, pose, yaw_rad):
    flags = draw_boxes(boxes_in_grid(actors, pose, yaw_rad), SPEC)
    others = [who for who in actors if not covers(who, pose)]
    for row, column in np.ndindex(flags.shape):
        expected, unsure = 0, 0
        for who in others:
            inside_m = slow_signed_m(who, pose, yaw_rad, SPEC, row, column)
            bit = MOVING if abs(who.velocity_x_mps) >= MOVING_FROM_MPS else STANDING
            expected |= bit if inside_m > 0 else 0
            unsure |= bit if abs(inside_m) < 1e-9 else 0
        assert (int(flags[row, column]) ^ expected) & ~unsure == 0


def covers(who, pose):
    """Whether the footprint itself, not grown, holds the vehicle's origin."""
    away = complex(pose.x_m - who.x_m, pose.y_m - who.y_m) * np.exp(-1j * who.yaw_rad)
    return abs(away.real) <= who.length_m / 2 and abs(away.imag) <= who.width_m / 2


def test_a_car_ahead_lies_where_the_arithmetic_says():
    flags = draw_boxes(boxes_in_grid([actor(4.0, 1.0)], Pose(0, 0.0, 0.0, 0.0), 0.0), SPEC)
    rows, columns = np.nonzero(flags)
    # 4 x 2 m and a margin of 0.78 m: 1.22 to 6.78 m ahead of row 20, 0.78 m right to 2.78 m left of column 11
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (6, 17, 5, 12)
    assert len(rows) == 12 * 8
    assert set(flags[flags > 0]) == {STANDING}


@pytest.mark.parametrize("cell_m", [100 / 128, 100 / 256, 0.1])
def test_the_margin_is_as_many_metres_on_a_finer_grid_and_a_cell_of_the_papers(cell_m):
    size = round(20 / cell_m)
    spec = GridSpec(rows=size, columns=size, cell_m=cell_m, agent_row=size, agent_column=size // 2)
    flags = draw_boxes(boxes_in_grid([actor(10.0, 0.0)], Pose(0, 0.0, 0.0, 0.0), 0.0), spec)
    length_m, width_m = (np.ptp(places) * cell_m + cell_m for places in np.nonzero(flags))
    assert (length_m, width_m) == pytest.approx((4.0 + 2 * 100 / 128, 2.0 + 2 * 100 / 128), abs=cell_m)


def test_the_vehicle_itself_is_no_actor():
    pose = Pose(0, 3.0, -2.0, 1.0)
    own = actor(pose.x_m + 1.3 * math.cos(1.0), pose.y_m + 1.3 * math.sin(1.0), 1.0, 4.5, 1.8, 8.0)
    assert boxes_in_grid([own], pose, 0.4).shape == (0, 6)
    assert not draw_boxes(boxes_in_grid([own], pose, 0.4), SPEC).any()


def with_truth(world, actors_at, *, skip=(), **changes):
    """A toy recording with poses and actors; `actors_at` gives the actors of a frame."""
    recording = world.recording(**changes)

    def moments():
        for frame, (moment, pose) in enumerate(zip(recording.moments(), world.poses(), strict=True)):
            truth = {} if frame in skip else {"actors": tuple(actors_at(frame))}
            yield dataclasses.replace(moment, pose=Pose(moment.stamp_ns, *pose), **truth)

    return dataclasses.replace(recording, moments=moments)


@pytest.mark.parametrize("yaw_rate_radps", [-0.3, 0.0, 0.3])
def test_footprints_lie_over_what_the_sensor_sees_of_a_parked_car(tmp_path, yaw_rate_radps):
    boxes = [Box("car", 15.0, 19.4, 2.0, 3.8, 1.5), Box("car", 24.0, 28.4, -5.8, -4.0, 1.5)]
    parked = [actor((b.x0 + b.x1) / 2, (b.y0 + b.y1) / 2, 0.0, b.x1 - b.x0, b.y1 - b.y0) for b in boxes]
    world = ToyWorld(boxes, speed_mps=6.0, yaw_rate_radps=yaw_rate_radps, frames=12)
    write_log(with_truth(world, lambda frame: parked), tmp_path / "toy.mcap")
    recording = build_log(tmp_path / "toy.mcap", GridConfig(morphology="off", integrator="arc"))[0]
    seen = recording.grids[0] == CAR
    assert recording.actors.shape == seen.shape
    assert seen[-1].sum() >= 4
    assert (recording.actors[seen] == STANDING).all()


def test_moving_actors_move_in_the_grid_and_standing_ones_come_nearer(tmp_path):
    world = ToyWorld(speed_mps=5.0, frames=10)
    step_s = FRAME_NS * 1e-9
    lead = [actor(20.0 + 5.0 * frame * step_s, 0.0, speed_mps=5.0) for frame in range(10)]
    parked = actor(30.0, 6.0)
    write_log(with_truth(world, lambda frame: [lead[frame], parked]), tmp_path / "toy.mcap")
    flags = build_log(tmp_path / "toy.mcap", GridConfig())[0].actors
    places = {bit: [np.argwhere(frame == bit).mean(axis=0) for frame in flags] for bit in (STANDING, MOVING)}
    assert np.abs(places[MOVING][9] - places[MOVING][0]).max() < 0.75
    down = places[STANDING][9][0] - places[STANDING][0][0]
    assert down == pytest.approx(5.0 * 9 * step_s / FULL.cell_m, abs=0.75)


def test_a_stretch_without_the_whole_truth_has_none_and_others_keep_theirs(tmp_path):
    world = street(1, frames=6)
    write_log(with_truth(world, lambda frame: [actor(20.0 + frame, 0.0)], skip={1}), tmp_path / "part.mcap")
    write_log(world.recording("bare"), tmp_path / "bare.mcap")
    first, second = build_log(tmp_path / "part.mcap", GridConfig(stretch_frames=3))
    assert first.actors is None
    assert second.actors is not None
    assert second.actors.any(axis=(1, 2)).all()
    assert build_log(tmp_path / "bare.mcap", GridConfig())[0].actors is None


def test_truth_is_kept_with_the_grids(tmp_path):
    logs = [tmp_path / "true.mcap", tmp_path / "bare.mcap"]
    write_log(with_truth(street(1, frames=2), lambda frame: [actor(20.0, 0.0, speed_mps=2.0)], name="true"), logs[0])
    write_log(street(1, frames=2).recording("bare"), logs[1])
    first, again = (build_grids(logs, tmp_path / "grids", GridConfig()) for _ in range(2))
    assert again.reused == 2
    np.testing.assert_array_equal(first.recordings[0].flags(), again.recordings[0].flags())
    assert set(np.unique(again.recordings[0].flags())) == {0, MOVING}
    assert not again.recordings[1].has_truth


def test_truth_that_is_not_finite_is_named(tmp_path):
    write_log(with_truth(street(1, frames=1), lambda frame: [actor(math.nan, 0.0)]), tmp_path / "toy.mcap")
    with pytest.raises(LogError, match=r"toy\.mcap: /truth/actors: is not finite at 1000000000000000000 ns"):
        build_log(tmp_path / "toy.mcap", GridConfig())
