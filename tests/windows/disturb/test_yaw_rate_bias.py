import math

import numpy as np
import pytest
import torch
from support.disturbed import SIDE, SPEC, batch_of, windows_of
from support.recordings import FRAME_NS, recording

from semgrid_eval.windows.disturb.turning import turn_grids


def grids_with(row, column, frames=4):
    grids = np.zeros((1, frames, SIDE, SIDE), np.uint8)
    grids[:, :, row, column] = 6
    return grids


def test_older_inputs_are_turned_further_to_the_right():
    windows = windows_of([recording(grids_with(1, 4))], [(0, (0, 2), 3)])
    bias_degps = 90 / (3 * FRAME_NS * 1e-9)  # a quarter turn from the oldest input to the target
    bias_degps = min(bias_degps, 90.0)
    found = batch_of(windows, kind="yaw_rate_bias", strength=bias_degps)
    for at, age in ((0, 3), (1, 1)):
        angle_rad = -math.radians(bias_degps) * age * FRAME_NS * 1e-9
        expected = turn_grids(torch.from_numpy(grids_with(1, 4, 1)[None]), np.array([[angle_rad]]), SPEC)
        assert torch.equal(found.past[0, 0, at], expected[0, 0, 0])
    columns = [np.argwhere(grid.numpy())[:, 1].mean() for grid in found.past[0, 0]]
    assert columns[0] > columns[1] >= 4, "columns grow to the right"


def test_the_way_since_bends_with_the_heading():
    # 2 m straight on between frames, and what stays in one place in the middle of the grid.
    position_m = np.stack([2.0 * np.arange(4), np.zeros(4)], axis=1)
    windows = windows_of([recording(grids_with(4, 4), position_m=position_m)], [(0, (0, 2), 3)])
    bias_degps = 80.0
    turns = [-math.radians(bias_degps) * age * FRAME_NS * 1e-9 for age in (3, 2, 1)]
    forward_m, left_m = sum(2 * math.cos(turn) for turn in turns), sum(2 * math.sin(turn) for turn in turns)
    found = batch_of(windows, kind="yaw_rate_bias", strength=bias_degps).shift_cells[0].tolist()
    assert found[0] == [round(forward_m), round(left_m)] == [6, -1]
    assert found[1] == [round(2 * math.cos(turns[2])), round(2 * math.sin(turns[2]))] == [2, 0]
    assert batch_of(windows).shift_cells[0].tolist() == [[6, 0], [2, 0]]


@pytest.mark.parametrize("translate", [True, False])
def test_the_other_sign_is_the_mirror_image_and_targets_stay(translate):
    random = np.random.default_rng(2)
    half = random.integers(0, 10, (1, 4, SIDE, 4), dtype=np.uint8)
    even = np.concatenate([half, half[..., ::-1]], axis=3)  # mirrored about the vehicle's axis
    spec = SPEC.model_copy(update={"columns": 8})
    windows = windows_of([recording(even)], [(0, (0, 1), 3)], spec=spec, translate=translate)
    left, right = (batch_of(windows, spec=spec, kind="yaw_rate_bias", strength=each) for each in (60.0, -60.0))
    assert torch.equal(left.past, right.past.flip(-1))
    assert torch.equal(left.target, batch_of(windows).target)
    assert torch.equal(left.mask, batch_of(windows).mask)


def test_no_bias_changes_nothing():
    random = np.random.default_rng(1)
    grids = random.integers(0, 10, (1, 4, SIDE, SIDE), dtype=np.uint8)
    windows = windows_of([recording(grids, position_m=random.normal(0, 2, (4, 2)))], [(0, (0, 1), 3)])
    plain, found = batch_of(windows), batch_of(windows, kind="yaw_rate_bias", strength=0.0)
    assert torch.equal(found.past, plain.past)
    assert torch.equal(found.shift_cells, plain.shift_cells)
