"""Where points of known direction are in a panorama."""

import math

import numpy as np
import pytest
from support.swept import sweep

from semgrid_eval.labels import LABEL_ID, label_palette
from semgrid_eval.recording.panorama import HEIGHT_PX, WIDTH_PX, panorama, panorama_png
from semgrid_eval.recording.png import decode_ids

CAR, POLE, ROAD = (LABEL_ID[name] for name in ("car", "pole", "road"))


def towards(azimuth_deg, elevation_deg, range_m=10.0):
    """A point in a direction, azimuth to the left."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    across_m = range_m * math.cos(elevation)
    return across_m * math.cos(azimuth), across_m * math.sin(azimuth), range_m * math.sin(elevation)


@pytest.mark.parametrize(
    ("azimuth_deg", "column"), [(-1, 128), (1, 127), (91, 63), (-89, 191), (179, 0), (-179, 255), (45.1, 95)]
)
def test_ahead_is_the_middle_and_left_is_left(azimuth_deg, column):
    found = panorama(sweep(0, [towards(azimuth_deg, -27.9)], ["car"]))
    assert found.shape == (HEIGHT_PX, WIDTH_PX)
    assert np.argwhere(found == CAR).tolist() == [[63, column]]


def test_up_is_up_and_gaps_below_a_point_are_closed_by_one_row():
    points = [towards(-1, 15.9), towards(-1, -6.1)]
    found = panorama(sweep(0, points, ["pole", "road"]))[:, 128]
    assert np.flatnonzero(found == POLE).tolist() == [0, 1]
    assert np.flatnonzero(found == ROAD).tolist() == [32, 33]


def test_what_is_nearest_is_shown_and_what_is_above_or_below_the_picture_is_not():
    points = [towards(-1, -27.9, 20), towards(-1, -27.9, 5), towards(-1, -27.9, 9), towards(-1, 40), towards(-1, -40)]
    found = panorama(sweep(0, points, ["road", "car", "pole", "wall", "wall"]))
    assert found[63, 128] == CAR
    assert np.count_nonzero(found) == 1


def test_the_picture_has_the_colours_of_its_labels():
    seen = sweep(0, [towards(-1, -20)], ["car"])
    png = panorama_png(seen)
    assert np.array_equal(decode_ids(png), panorama(seen))
    assert bytes(label_palette()[CAR].tolist()) in png


def test_a_sweep_without_points_is_a_black_picture():
    assert not panorama(sweep(0, [], [])).any()
