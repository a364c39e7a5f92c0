import base64
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from support.own_classes import class_set

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, DEFAULT_CLASSES, MASK_COLOUR
from semgrid_eval.errors import InputError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.examples.drawing import (
    POINTLESS_COLOUR,
    RIGHT_COLOURS,
    certainty_png,
    data_uri,
    grid_picture,
    label_picture,
    masked_picture,
    right_png,
)

GRIDS = arrays(np.uint8, (5, 7), elements=st.integers(0, CLASS_COUNT - 1))


def _png(picture):
    return base64.b64decode(picture.uri.removeprefix("data:image/png;base64,"))


def _colours(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


@given(GRIDS, arrays(np.bool_, (5, 7)))
def test_each_cell_has_its_class_colour_and_the_mask_is_white(grid, mask):
    got = _colours(_png(masked_picture(("", ""), grid, mask, DEFAULT_CLASSES)))
    assert (got[mask] == MASK_COLOUR).all()
    np.testing.assert_array_equal(got[~mask], DEFAULT_CLASSES.palette(safe=True)[grid[~mask]])


def test_64_classes_keep_their_colours():
    labels = ({"name": f"c{i}", "category": "c", "labels": [i], "colour": [i, 255 - i, 7]} for i in range(1, 64))
    many, grid = class_set(*labels, categories=[{"name": "c"}]), np.arange(64, dtype=np.uint8).reshape(8, 8)
    mask = np.zeros((8, 8), np.bool_)
    mask[0, 0] = True
    got = _colours(_png(masked_picture(("", ""), grid, mask, many))).reshape(-1, 3)
    assert tuple(got[0]) == MASK_COLOUR
    np.testing.assert_array_equal(got[1:], many.palette()[1:])


def test_a_label_image_has_the_colours_of_its_classes_and_a_gray_for_what_is_in_no_grid():
    stream = io.BytesIO()
    Image.fromarray(np.array([[7, 23], [8, 7]], np.uint8)).save(stream, "PNG")
    picture = label_picture(("Segmentation", "Street"), stream.getvalue(), GridConfig())
    road, sidewalk = (CLASS_NAMES.index(name) for name in ("road", "sidewalk"))
    got = _colours(base64.b64decode(picture.uri.removeprefix("data:image/png;base64,")))
    palette = [*DEFAULT_CLASSES.palette(safe=True).tolist(), MASK_COLOUR, POINTLESS_COLOUR]
    np.testing.assert_array_equal(got, np.array(palette)[[[road, CLASS_COUNT + 1], [sidewalk, road]]])
    assert picture.colours == {road, sidewalk, CLASS_COUNT + 1}


def test_a_label_image_that_is_too_large_is_not_decoded():
    stream = io.BytesIO()
    Image.new("1", (20_000, 20_000)).save(stream, "PNG")
    with pytest.raises(InputError, match="pixels are allowed"):
        label_picture(("", ""), stream.getvalue(), GridConfig())


def test_who_is_right_names_each_case():
    target = np.array([[1, 1, 1, 1, 0, 1]], np.uint8)
    mine = np.array([[1, 1, 2, 2, 0, 1]], np.uint8)
    theirs = np.array([[1, 2, 1, 3, 0, 1]], np.uint8)
    mask = np.array([[False, False, False, False, False, True]])
    expected = [RIGHT_COLOURS[i] for i in (1, 2, 3, 4, 0, 5)]
    np.testing.assert_array_equal(_colours(right_png(target, mine, theirs, mask))[0], expected)


def test_certainty_is_lighter_where_it_is_higher():
    light = _colours(certainty_png(np.array([[0, 26, 80, 140, 200, 255]], np.uint8), CLASS_COUNT))[0].sum(axis=1)
    assert light[0] == light[1]  # nothing is less certain than one in ten
    assert (np.diff(light[1:].astype(int)) > 0).all()


def test_a_picture_is_small_and_carried_as_a_data_uri():
    png = _png(grid_picture(("", ""), np.zeros((128, 128), np.uint8), DEFAULT_CLASSES))
    assert len(png) < 500
    assert base64.b64decode(data_uri(png).removeprefix("data:image/png;base64,")) == png
