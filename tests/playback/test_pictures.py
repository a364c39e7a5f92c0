import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES, MASK_COLOUR
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.log import grids
from semgrid_eval.playback.pictures import grid_picture, legend, row_name


def drawn(message):
    """The picture in a message: (H, W, 3) sRGB."""
    return cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def test_a_picture_has_the_colours_of_the_viewers_grid_and_m_in_white():
    values = np.arange(2 * CLASS_COUNT, dtype=np.uint8).reshape(2, -1) % CLASS_COUNT
    mask = np.zeros_like(values)
    mask[1, 3] = 1
    message = grid_picture(7_000_000_001, values, grids.class_layer(DEFAULT_CLASSES), mask)
    assert (message.format, message.frame_id) == ("png", "grid")
    assert (message.timestamp.seconds, message.timestamp.nanos) == (7, 1)
    picture = drawn(message)
    for row, column in np.ndindex(*values.shape):
        expected = MASK_COLOUR if mask[row, column] else DEFAULT_CLASSES.classes[values[row, column]].colour
        assert tuple(picture[row, column].tolist()) == expected
    assert values.max() == CLASS_COUNT - 1, "the grid itself is as it was"


def test_certainty_goes_from_black_to_white():
    values = np.array([[0, 128, 255]], np.uint8)
    np.testing.assert_array_equal(drawn(grid_picture(0, values, grids.CERTAINTY))[..., 0], values)


@pytest.mark.parametrize("rows", [("ED-DC",), ("a", "Zürich\n\x1b[31m 東京", "x" * 200)])
def test_the_legend_shows_each_colour_and_grows_with_the_rows(rows):
    picture = drawn(legend(0, rows, DEFAULT_CLASSES))
    found = {tuple(colour) for colour in picture.reshape(-1, 3).tolist()}
    assert {each.colour for each in DEFAULT_CLASSES.classes} | {MASK_COLOUR} <= found
    assert picture.shape[0] > drawn(legend(0, rows[1:], DEFAULT_CLASSES)).shape[0]
    assert not np.array_equal(
        drawn(legend(0, ("other",), DEFAULT_CLASSES)), drawn(legend(0, ("names",), DEFAULT_CLASSES))
    )


@pytest.mark.parametrize(("name", "shown"), [("ED-DC", "ED-DC"), ("a\nb", "a\\nb"), ("x" * 200, "x" * 200)])
def test_a_rows_name_lies_within_its_grid(name, shown):
    spec = GridSpec()
    (entity,) = SceneUpdate.FromString(row_name(5, name, spec).SerializeToString()).entities
    (text,) = entity.texts
    assert (text.text, entity.frame_id, entity.frame_locked) == (shown, "grid", True)
    assert not entity.HasField("lifetime"), "it holds until another one comes"
    assert 0 < text.pose.position.x < spec.agent_row * spec.cell_m
    assert len(shown) * text.font_size * 0.6 <= spec.columns * spec.cell_m + 1e-9
