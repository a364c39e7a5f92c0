import math

import numpy as np
import pytest

from semgrid_eval.sources.town.polyline import Polyline

CORNER = Polyline.through(np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 0.0), (10.0, 5.0)]))


def test_places_lie_along_the_line_and_to_its_left():
    assert CORNER.length_m == pytest.approx(15.0)
    assert CORNER.at(4.0, 2.0) == pytest.approx((4.0, 2.0, 0.0))
    assert CORNER.at(12.0, 2.0) == pytest.approx((8.0, 2.0, math.pi / 2))


def test_beyond_its_ends_a_line_goes_straight_on():
    assert CORNER.at(-3.0) == pytest.approx((-3.0, 0.0, 0.0))
    assert CORNER.at(17.0) == pytest.approx((10.0, 7.0, math.pi / 2))


def test_a_piece_keeps_the_corners_inside_it():
    np.testing.assert_allclose(CORNER.piece(8.0, 12.0), [(8, 0), (10, 0), (10, 2)])
