"""What all metrics count by: cells by region and code, whatever their type and order in memory."""

import numpy as np
import pytest

from semgrid_eval.scores.metrics.metric import Regions


@pytest.mark.parametrize("dtype", [np.int8, np.int32, np.int64])
def test_cells_are_tallied_by_window_region_and_code(dtype):
    random = np.random.default_rng(0)
    number = random.integers(-1, 3, (4, 8, 5)).astype(dtype).transpose(0, 2, 1)
    codes = random.integers(-1, 7, (4, 5, 8))
    expected = np.zeros((4, 3, 7), np.int64)
    for window, row, column in np.ndindex(codes.shape):
        if min(number[window, row, column], codes[window, row, column]) >= 0:
            expected[window, number[window, row, column], codes[window, row, column]] += 1
    assert np.array_equal(Regions(number, 3).tally(codes, 7), expected)


def test_no_windows_have_no_tally():
    assert Regions(np.zeros((0, 2, 2), np.int64), 3).tally(np.zeros((0, 2, 2), np.int64), 7).shape == (0, 3, 7)


@pytest.mark.parametrize(("regions", "size"), [(2, 7), (3, 6)])
def test_a_region_or_code_beyond_the_table_is_an_error(regions, size):
    number, codes = np.full((1, 2, 2), 2), np.full((1, 2, 2), 6)
    with pytest.raises(IndexError, match="too large"):
        Regions(number, regions).tally(codes, size)
