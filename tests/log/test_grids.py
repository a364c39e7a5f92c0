import numpy as np
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from support.exact_grids import read_exact

from semgrid_eval.classes import CLASS_NAMES, DEFAULT_CLASSES
from semgrid_eval.log.grids import CERTAINTY, MASK, GridPlace, class_layer, exact_message, viewer_message

ROAD, CAR, PERSON = (CLASS_NAMES.index(name) for name in ("road", "car", "person"))
CLASS_LAYER = class_layer(DEFAULT_CLASSES)
PLACE = GridPlace(cell_m=0.5, corner_x_m=2.0, corner_y_m=1.0)  # 4 rows ahead of the origin, 2 columns left of it


def cells(message):
    """Every cell as a viewer draws it: centre (x, y) -> its fields by name, by the documentation of foxglove.Grid."""
    found = {}
    count = len(message.data) // message.row_stride
    for row in range(count):
        for column in range(message.column_count):
            x = message.pose.position.x + (column + 0.5) * message.cell_size.x
            y = message.pose.position.y + (row + 0.5) * message.cell_size.y
            start = row * message.row_stride + column * message.cell_stride
            found[round(x, 6), round(y, 6)] = {f.name: message.data[start + f.offset] for f in message.fields}
    return found


def test_an_asymmetric_grid_lies_ahead_and_left_as_it_should():
    values = np.zeros((4, 3), np.uint8)
    values[0, 0] = CAR  # farthest ahead and farthest left
    values[3, 2] = PERSON  # nearest and farthest right
    values[0, 2] = ROAD  # farthest ahead and farthest right
    drawn = cells(viewer_message(1, values, CLASS_LAYER, PLACE))
    assert len(drawn) == 12
    known = {place: cell["class_id"] for place, cell in drawn.items() if cell["class_id"]}
    assert known == {(1.75, 0.75): CAR, (0.25, -0.25): PERSON, (1.75, -0.25): ROAD}
    car = drawn[1.75, 0.75]
    assert (car["red"], car["green"], car["blue"], car["alpha"]) == (*DEFAULT_CLASSES.classes[CAR].colour, 255)
    assert drawn[0.25, 0.75]["alpha"] == 0, "unknown hides nothing"


@settings(max_examples=30, deadline=None)
@given(
    npst.arrays(np.uint8, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(0, 255)),
    st.sampled_from([CLASS_LAYER, MASK, CERTAINTY]),
)
def test_viewer_message_has_the_value_of_each_cell_where_it_lies(values, layer):
    drawn = cells(viewer_message(5, values, layer, PLACE))
    for (row, column), value in np.ndenumerate(values):
        cell = drawn[round(2.0 - (row + 0.5) * 0.5, 6), round(1.0 - (column + 0.5) * 0.5, 6)]
        assert cell[layer.field] == value
        assert [cell[name] for name in ("red", "green", "blue", "alpha")] == layer.rgba[value].tolist()


def test_mask_is_white_where_cells_are_left_out_and_clear_elsewhere():
    drawn = cells(viewer_message(1, np.array([[1, 0]], np.uint8), MASK, PLACE))
    assert sorted(tuple(cell.values()) for cell in drawn.values()) == [(0, 0, 0, 0, 0), (255, 255, 255, 255, 1)]


def test_certainty_is_a_grey_of_its_own_value():
    (cell,) = cells(viewer_message(1, np.array([[77]], np.uint8), CERTAINTY, PLACE)).values()
    assert cell == {"red": 77, "green": 77, "blue": 77, "alpha": 255, "certainty": 77}


def test_fields_are_bytes_and_every_part_of_the_pose_is_set():
    message = viewer_message(3_000_000_007, np.zeros((2, 3), np.uint8), CLASS_LAYER, PLACE)
    assert {field.type for field in message.fields} == {PackedElementField.UINT8}
    assert (message.timestamp.seconds, message.timestamp.nanos) == (3, 7)
    assert message.pose.HasField("position")
    assert message.pose.orientation.w == 1.0
    assert message.frame_id == "grid"


@settings(max_examples=30, deadline=None)
@given(npst.arrays(np.uint8, st.tuples(st.integers(1, 6), st.integers(1, 6))))
def test_exact_message_comes_back_whole(values):
    message = exact_message(9, values, CLASS_LAYER, PLACE)
    read, place = read_exact(message.SerializeToString())
    assert np.array_equal(read, values)
    assert place == PLACE
    assert tuple(message.class_names) == CLASS_NAMES


def test_exact_message_of_a_turned_view_is_row_by_row():
    values = np.arange(6, dtype=np.uint8).reshape(2, 3)
    assert exact_message(9, values.T, CLASS_LAYER, PLACE).class_ids == bytes([0, 3, 1, 4, 2, 5])
