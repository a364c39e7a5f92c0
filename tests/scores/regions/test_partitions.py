"""Every partition against a loop over cells, and what holds of all of them."""

import math

import numpy as np
import pytest
from support.windows import SPEC, random_windows

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.scores.metrics.table import METRICS, count_windows
from semgrid_eval.scores.regions.distance import bands_of
from semgrid_eval.scores.regions.table import PARTITIONS


def slow_distance(scored, n, row, column):
    forward_m, left_m = (SPEC.agent_row - row - 0.5) * SPEC.cell_m, (SPEC.agent_column - column - 0.5) * SPEC.cell_m
    return sum(math.hypot(forward_m, left_m) >= edge for edge in (20, 40, 60))


def slow_origin(scored, n, row, column):
    past = scored.inputs[n, :, :, row, column]
    if any(sensor[-1] != UNKNOWN for sensor in past):
        return 0
    return 1 if any(cell != UNKNOWN for sensor in past for cell in sensor) else 2


def slow_actors(scored, n, row, column):
    return {0: -1, 1: 1, 2: 0, 3: 0}[int(scored.actors[n, row, column])]


SLOW = {"all": lambda *_: 0, "distance": slow_distance, "origin": slow_origin, "actors": slow_actors}


@pytest.mark.parametrize("name", PARTITIONS)
def test_cells_are_in_the_region_that_a_loop_finds(name):
    scored, partition = random_windows(2), PARTITIONS[name]
    number = partition.number(scored)
    for at in np.ndindex(scored.target.shape):
        assert number[at] == SLOW[name](scored, *at)
    assert set(np.unique(number)) - {-1} == set(range(len(partition.regions)))


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("name", ["distance", "origin"])
def test_regions_that_cover_the_grid_add_up_to_all_cells(metric, name):
    sums = count_windows(random_windows(4))
    np.testing.assert_array_equal(sums[metric, name].sum(axis=1), sums[metric, "all"][:, 0])


def test_bands_grow_with_the_distance_from_the_bottom_middle():
    bands = bands_of(GridSpec())
    assert bands[127, 63] == bands[127, 64] == bands[104, 64] == 0
    assert bands[0, 64] == 3
    np.testing.assert_array_equal(bands, bands[:, ::-1])
    assert bands[101, 64] == 1  # 20.7 m ahead
    assert bands[127, 0] == 2  # 49.6 m to the left
