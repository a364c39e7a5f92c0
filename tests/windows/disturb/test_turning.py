import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.windows.disturb.turning import turn_grids

MIDDLE = GridSpec(rows=8, columns=8, cell_m=0.5, agent_row=4, agent_column=4)


def turned(grid, angle_rad, spec=MIDDLE):
    grids = torch.from_numpy(grid)[None, None, None]
    return turn_grids(grids, np.array([[angle_rad]]), spec)[0, 0, 0].numpy()


def slow_turned(grid, angle_rad, spec):
    """For each cell: where was its middle before it was turned?"""
    result = np.zeros_like(grid)
    for row in range(spec.rows):
        for column in range(spec.columns):
            forward_m = (spec.agent_row - row - 0.5) * spec.cell_m
            left_m = (spec.agent_column - column - 0.5) * spec.cell_m
            radius_m, bearing_rad = math.hypot(forward_m, left_m), math.atan2(left_m, forward_m) - angle_rad
            old_row = math.floor(spec.agent_row - radius_m * math.cos(bearing_rad) / spec.cell_m)
            old_column = math.floor(spec.agent_column - radius_m * math.sin(bearing_rad) / spec.cell_m)
            if 0 <= old_row < spec.rows and 0 <= old_column < spec.columns:
                result[row, column] = grid[old_row, old_column]
    return result


def test_a_quarter_turn_to_the_left_brings_what_is_ahead_to_the_left():
    grid = np.zeros((8, 8), np.uint8)
    grid[0, 3] = 6  # straight ahead, the cell left of the axis
    expected = np.zeros((8, 8), np.uint8)
    expected[4, 0] = 6  # to the left, the cell behind the axis
    np.testing.assert_array_equal(turned(grid, math.pi / 2), expected)
    np.testing.assert_array_equal(turned(grid, math.pi / 2), np.rot90(grid))


def test_no_turn_changes_nothing_and_what_comes_from_outside_is_unknown():
    grid = np.random.default_rng(0).integers(1, 10, (8, 8), dtype=np.uint8)
    np.testing.assert_array_equal(turned(grid, 0.0), grid)
    eighth = turned(grid, math.pi / 4)
    assert eighth[0, 0] == eighth[7, 7] == 0
    assert (eighth[2:6, 2:6] > 0).all()


@settings(max_examples=30)
@given(st.floats(-3.1, 3.1), st.integers(0, 9), st.integers(0, 7), st.integers(0, 99))
def test_turns_match_a_slow_twin(angle_rad, agent_row, agent_column, seed):
    spec = GridSpec(rows=9, columns=8, cell_m=0.7, agent_row=agent_row, agent_column=agent_column)
    grid = np.random.default_rng(seed).integers(0, 10, (9, 8), dtype=np.uint8)
    differing = turned(grid, angle_rad, spec) != slow_turned(grid, angle_rad, spec)
    assert differing.sum() <= 1 + 4 * (abs(angle_rad) < 1e-6), "rounding may take the cell beside"


@pytest.mark.parametrize("angle_rad", [0.3, -1.0])
def test_every_input_is_turned_by_its_own_angle(angle_rad):
    grids = torch.randint(0, 10, (2, 3, 2, 8, 8), dtype=torch.uint8)
    found = turn_grids(grids, np.array([[0.0, angle_rad], [angle_rad, 0.0]]), MIDDLE)
    assert torch.equal(found[0, :, 0], grids[0, :, 0])
    assert torch.equal(found[1, :, 1], grids[1, :, 1])
    np.testing.assert_array_equal(found[0, 2, 1].numpy(), turned(grids[0, 2, 1].numpy(), angle_rad))
    np.testing.assert_array_equal(found[1, 1, 0].numpy(), turned(grids[1, 1, 0].numpy(), angle_rad))
