"""BL-Flow: streets drawn by hand, where each piece of evidence decides, and BL-Fuse wherever nothing moves."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from support.models import given as given_by
from support.models import made

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.models.flow import FlowSettings, MoveOn, find_moves
from semgrid_eval.models.overlay import FuseAll
from semgrid_eval.windows.data import WindowBatch

UNKNOWN, ROAD, BUILDING, CAR, PERSON = (
    CLASS_NAMES.index(name) for name in ("unknown", "road", "building", "car", "person")
)
CELL_M, GAP_S = 0.8, 0.3


def road(rows=24, columns=24):
    return np.full((rows, columns), ROAD, np.uint8)


def with_box(grid, row, column, class_id=CAR, rows=4, columns=2):
    grid = grid.copy()
    grid[row : row + rows, column : column + columns] = class_id
    return grid


def batch_of(*grids, steps=1.0):
    """A batch of one window from grids, oldest first, `GAP_S` apart, the target `steps` gaps after the last."""
    past = torch.from_numpy(np.stack(grids))[None, None]
    count = len(grids)
    lead_s = torch.tensor([[GAP_S * (count - 1 - t + steps) for t in range(count)]])
    target = torch.zeros(1, *grids[0].shape, dtype=torch.uint8)
    return WindowBatch(past, ("full",), torch.zeros(1, count, 2, dtype=torch.int64), lead_s, target, target.bool())


def flow(**settings):
    return made(MoveOn, given_by(cell_m=CELL_M), **settings)


def moved_on(*grids, steps=1.0, **config):
    scores = flow(**config).predict(batch_of(*grids, steps=steps))
    assert torch.equal(scores.sum(dim=1), torch.ones(scores[:, 0].shape))
    return scores.argmax(dim=1)[0].numpy()


def fused(*grids):
    return made(FuseAll).predict(batch_of(*grids)).argmax(dim=1)[0].numpy()


@pytest.mark.parametrize(("steps", "ahead"), [(1.0, 3), (2.0, 6), (0.5, 2)])
def test_a_car_that_drove_drives_on_and_leaves_no_ghost(steps, ahead):
    older, newer = with_box(road(), 14, 8), with_box(road(), 11, 8)
    np.testing.assert_array_equal(moved_on(older, newer, steps=steps), with_box(road(), 11 - ahead, 8))


def test_what_leaves_the_grid_is_gone():
    older, newer = with_box(road(), 5, 8), with_box(road(), 2, 8)
    np.testing.assert_array_equal(moved_on(older, newer, steps=2.0), road())


def test_a_place_never_seen_bare_becomes_what_is_around_it():
    older, newer = with_box(road(), 14, 8), with_box(road(), 11, 8)
    older[11:14, 8:10] = UNKNOWN  # behind the car
    assert (moved_on(older, newer, seen=0.0) == with_box(road(), 8, 8)).all()


def test_only_the_two_newest_inputs_tell_the_motion():
    grids = [with_box(road(), row, 8) for row in (2, 14, 11)]
    np.testing.assert_array_equal(moved_on(*grids), with_box(road(), 8, 8))


@pytest.mark.parametrize("count", [1, 2])
def test_sensors_are_overlaid_before_anything_is_looked_for(count):
    grids = [with_box(road(), row, 8) for row in (14, 11)][-count:]
    whole = batch_of(*grids)
    halves = whole.past.repeat(1, 2, 1, 1, 1)
    halves[:, 0, :, :, :9] = UNKNOWN
    halves[:, 1, :, :, 9:] = UNKNOWN
    split = WindowBatch(halves, ("left", "right"), whole.shift_cells, whole.lead_s, whole.target, whole.mask)
    assert torch.equal(flow().predict(split), flow().predict(whole))


STAYS = {
    "a motion within the rounding": (with_box(road(), 12, 8), with_box(road(), 11, 8), {"least_motion_cells": 1.0}),
    "a jump faster than the limit": (with_box(road(), 19, 8), with_box(road(), 8, 8), {"speed_limit_mps": 40.0}),
    "a person where only vehicles are to move": (
        with_box(road(), 14, 8, PERSON, 2, 2),
        with_box(road(), 11, 8, PERSON, 2, 2),
        {"small_speed_limit_mps": 10.0},
    ),
    "another shape": (
        with_box(road(), 14, 8, CAR, 2, 4),
        with_box(road(), 11, 8, CAR, 4, 2),
        {"overlap": 0.3},
    ),
    "another size": (
        with_box(road(), 14, 8, CAR, 2, 2),
        with_box(road(), 10, 8, CAR, 5, 2),
        {"size_ratio": 0.3, "overlap": 0.3},
    ),
    "a speck": (with_box(road(), 14, 8, CAR, 1, 2), with_box(road(), 11, 8, CAR, 1, 2), {"least_cells": 1}),
    "a parked row of which one car and then its neighbour is seen": (
        with_box(with_box(road(), 14, 8), 10, 8, UNKNOWN, 4, 2),
        with_box(with_box(road(), 10, 8), 14, 8, UNKNOWN, 4, 2),
        {"seen": 0.0},
    ),
    "a place that is taken again by the class": (
        with_box(road(), 14, 8),
        with_box(with_box(road(), 11, 8), 16, 6, CAR, 2, 8),
        {"still_there": 1.0},
    ),
}


@pytest.mark.parametrize("case", STAYS)
def test_each_piece_of_evidence_alone_keeps_cells_as_they_were_fused(case):
    older, newer, lax = STAYS[case]
    assert find_moves(older, newer, GAP_S / CELL_M, DEFAULT_CLASSES, FlowSettings()) == []
    np.testing.assert_array_equal(moved_on(older, newer), fused(older, newer))
    assert len(find_moves(older, newer, GAP_S / CELL_M, DEFAULT_CLASSES, FlowSettings(**lax))) == 1


def test_classes_do_not_turn_into_each_other():
    older, newer = with_box(road(), 14, 8, CLASS_NAMES.index("large_vehicle")), with_box(road(), 11, 8)
    np.testing.assert_array_equal(moved_on(older, newer), fused(older, newer))


def test_two_cars_in_a_lane_are_not_mixed_up():
    older = with_box(with_box(road(), 18, 8), 10, 8)
    newer = with_box(with_box(road(), 15, 8), 7, 8)
    np.testing.assert_array_equal(moved_on(older, newer), with_box(with_box(road(), 12, 8), 4, 8))
    moves = find_moves(older, newer, GAP_S / CELL_M, DEFAULT_CLASSES, FlowSettings())
    assert [move.shift.tolist() for move in moves] == [[-3, 0]] * 2


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_a_world_that_stands_still_but_flickers_is_fused(seed, count):
    random = np.random.default_rng(seed)
    world = np.kron(random.integers(0, 10, (6, 6), dtype=np.uint8), np.ones((3, 3), np.uint8))
    grids = [np.where(random.random(world.shape) < 0.15, UNKNOWN, world).astype(np.uint8) for _ in range(count)]
    np.testing.assert_array_equal(moved_on(*grids), fused(*grids))


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_any_grids_give_classes_and_each_component_moves_once(seed):
    random = np.random.default_rng(seed)
    older, newer = (np.kron(random.integers(0, 10, (8, 8)), np.ones((2, 2))).astype(np.uint8) for _ in range(2))
    config = FlowSettings(overlap=0, size_ratio=0, seen=0, still_there=1)
    moves = find_moves(older, newer, 5.0, DEFAULT_CLASSES, config)
    assert moved_on(older, newer, **config.model_dump()).max() < len(CLASS_NAMES)
    for grid, cells in ((older, [move.older for move in moves]), (newer, [move.newer for move in moves])):
        places = np.concatenate([*cells, np.zeros((0, 2), int)])
        assert len(np.unique(places, axis=0)) == len(places)
        for move, mine in zip(moves, cells, strict=True):
            assert (grid[tuple(mine.T)] == move.class_id).all()
            assert move.class_id in DEFAULT_CLASSES.movable


def test_two_inputs_of_one_time_tell_no_motion():
    older, newer = with_box(road(), 14, 8), with_box(road(), 11, 8)
    np.testing.assert_array_equal(moved_on(older, newer, steps=1.0), with_box(road(), 8, 8))
    batch = batch_of(older, newer)
    batch.lead_s[:] = GAP_S
    assert torch.equal(flow().predict(batch), made(FuseAll).predict(batch))
