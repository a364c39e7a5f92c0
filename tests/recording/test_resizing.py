"""Which pixel another size takes from where."""

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.recording.resizing import nearest, nearest_indices

SIDES = st.integers(1, 40)


@pytest.mark.parametrize(("source", "target"), [(2048, 512), (1241, 512), (376, 256), (100, 256), (7, 7)])
def test_nearest_indices_pick_the_closest_centre(source, target):
    centres = (np.arange(target) + 0.5) / target
    distance = np.abs((np.arange(source) + 0.5) / source - centres[:, None])
    picked = nearest_indices(source, target)
    np.testing.assert_allclose(distance[np.arange(target), picked], distance.min(axis=1), atol=1e-12)


@given(st.integers(0, 99), SIDES, SIDES, SIDES, SIDES)
def test_a_pixel_is_that_whose_area_holds_its_centre(seed, height, width, new_height, new_width):
    rows = [floor(Fraction(2 * row + 1, 2) / new_height * height) for row in range(new_height)]
    columns = [floor(Fraction(2 * column + 1, 2) / new_width * width) for column in range(new_width)]
    ids = np.random.default_rng(seed).integers(0, 34, (height, width)).astype(np.uint8)
    assert np.array_equal(nearest(ids, (new_width, new_height)), ids[np.ix_(rows, columns)])
