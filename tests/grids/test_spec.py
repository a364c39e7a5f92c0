import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.grids.spec import GridConfig, GridSpec


def boxes(config):
    return {s.name: (s.top_px, s.bottom_px, s.left_px, s.right_px) for s in config.all_sensors()}


def test_default_sensors_are_the_supplements_splits():
    assert boxes(GridConfig()) == {
        "full": (0, 256, 0, 512),
        "split1_upper": (0, 130, 0, 512),
        "split1_lower": (130, 256, 0, 512),
        "split2_upper": (0, 125, 40, 472),
        "split2_lower": (145, 256, 40, 472),
    }


def test_rows_counted_from_the_bottom_move_the_blind_band_up():
    turned = boxes(GridConfig(y_axis="up"))
    assert turned["split2_upper"] == (0, 111, 40, 472)
    assert turned["split2_lower"] == (131, 256, 40, 472)
    assert turned["split1_upper"] == (0, 126, 0, 512)


def test_splits_scale_with_the_image():
    assert boxes(GridConfig(image_size_px=(1024, 512)))["split2_lower"] == (290, 512, 80, 944)


def test_centres_are_half_a_cell_from_the_vehicle_and_a_cell_apart():
    spec = GridSpec(rows=9, columns=8, cell_m=2.0, agent_row=7, agent_column=3)
    forward_m, left_m = spec.centres_m()
    assert forward_m.tolist() == [13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0, -1.0, -3.0]
    assert left_m.tolist() == [5.0, 3.0, 1.0, -1.0, -3.0, -5.0, -7.0, -9.0]


@given(
    st.builds(
        GridSpec,
        rows=st.integers(8, 40),
        columns=st.integers(8, 40),
        cell_m=st.floats(0.02, 10),
        agent_row=st.integers(0, 8),
        agent_column=st.integers(0, 8),
    )
)
def test_a_point_at_a_cells_centre_is_drawn_in_that_cell(spec):
    forward_m, left_m = spec.centres_m()
    rows = [spec.agent_row - 1 - math.floor(metres / spec.cell_m) for metres in forward_m]
    columns = [spec.agent_column - 1 - math.floor(metres / spec.cell_m) for metres in left_m]
    assert (rows, columns) == (list(range(spec.rows)), list(range(spec.columns)))


@pytest.mark.parametrize(
    ("value", "place"),
    [
        ({"morfology": "off"}, "morfology: unknown key"),
        ({"morphology": "none"}, "morphology"),
        ({"spec": {"rows": 0}}, "spec.rows"),
        ({"image_size_px": [4, 4]}, "outside 16 to 8192"),
        ({"sensors": [{"name": "a", "bottom_px": 300, "right_px": 10}]}, "reaches beyond the image"),
        ({"sensors": [{"name": "full", "bottom_px": 30, "right_px": 10}]}, "repeat"),
        ({"spec": {"rows": "128"}}, "spec.rows"),
    ],
)
def test_impossible_configurations_name_the_place(value, place):
    with pytest.raises(ConfigError, match="grids.yaml: .*" + place):
        parse_config(GridConfig, value, path="grids.yaml")
