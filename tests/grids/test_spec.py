import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.runs.data import grid_digest
from semgrid_eval.sensors.camera import CameraSensor


def boxes(config):
    return {name: sensor.crop_px for name, sensor in config.sensors.items()}


def test_default_sensors_are_the_supplements_splits():
    assert boxes(GridConfig()) == {
        "full": (0, 256, 0, 512),
        "split1_upper": (0, 130, 0, 512),
        "split1_lower": (130, 256, 0, 512),
        "split2_upper": (0, 125, 40, 472),
        "split2_lower": (145, 256, 40, 472),
    }


def test_there_are_grids_of_each_sensor_and_of_a_target_of_several():
    sensors = {name: CameraSensor(camera=name) for name in ("front", "rear", "side")}
    alone, both = (GridConfig(sensors=sensors, target=target) for target in (("rear",), ("rear", "front")))
    assert alone.rows == {name: (name,) for name in sensors}
    assert both.rows == {**alone.rows, "rear+front": ("rear", "front")}
    assert (alone.target_row, both.target_row) == ("rear", "rear+front")
    assert both.camera == sensors["rear"]


def test_targets_are_the_same_whatever_else_there_is_and_whatever_sensors_are_called():
    plain = GridConfig()
    alone = GridConfig(sensors={"whole": CameraSensor()}, target=("whole",))
    assert alone.target_identity() == plain.target_identity()
    others = [
        GridConfig(morphology="off"),
        GridConfig(integrator="arc"),
        GridConfig(stretch_frames=29),
        GridConfig(class_map={"terrain": None}),
        GridConfig(spec=GridSpec(rows=64, agent_row=64)),
        GridConfig(sensors={"full": CameraSensor(image_size_px=(1024, 512))}),
        GridConfig(sensors={"full": CameraSensor(exclude_border_px=1)}),
        GridConfig(sensors={"full": CameraSensor(exclude_depth_step_px=0.5)}),
        GridConfig(target=("split1_upper",)),
        GridConfig(target=("split1_upper", "split1_lower")),
    ]
    assert len({json.dumps(config.target_identity()) for config in (plain, *others)}) == 1 + len(others)


@pytest.mark.parametrize("sensor", [CameraSensor(camera="rear", top_px=7), CameraSensor(exclude_border_px=3)])
def test_settings_come_back_from_json(sensor):
    config = GridConfig(sensors={"a": sensor}, target=("a",))
    assert parse_config(GridConfig, config.model_dump(mode="json")) == config


def test_grids_of_all_pixels_are_what_they_were_before_any_could_be_left_out():
    assert grid_digest(GridConfig()) == "961a43ac9b56180b"
    assert grid_digest(GridConfig(sensors={"full": CameraSensor(exclude_border_px=1)})) != grid_digest(
        GridConfig(sensors={"full": CameraSensor()})
    )


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
        ({"sensors": {"full": {"image_size_px": [4, 4]}}}, "sensors.full: .*outside 16 to 8192"),
        ({"sensors": {"full": {"bottom_px": 300}}}, "sensors.full: .*reach beyond the image"),
        ({"sensors": {"full": {"bottom_px": 30, "top_px": 30}}}, "sensors.full: .*cover no pixel"),
        (
            {"sensors": {"full": {"top": 30}}},
            "sensors.full: top: unknown key; allowed here: bottom_px, camera, .*top_px",
        ),
        ({"sensors": {"full": {"kind": "sonar"}}}, "sensors.full: kind: 'sonar' is not one of camera, lidar, tracks"),
        ({"sensors": {"full": {"kind": ["camera"]}}}, "sensors.full: kind: .* is not one of camera, lidar, tracks"),
        ({"sensors": {"full": {"bottom_px": "3"}}}, "sensors.full.bottom_px: .*not '3'"),
        ({"sensors": {"full": {"exclude_border_px": -1}}}, "sensors.full.exclude_border_px: .*not -1"),
        ({"sensors": {"full": {"exclude_border_px": 1.5}}}, "sensors.full.exclude_border_px: .*not 1.5"),
        ({"sensors": {"full": {"exclude_depth_step_px": 0}}}, "sensors.full.exclude_depth_step_px: .*not 0"),
        ({"sensors": {"full": 3}}, "sensors.full"),
        ({"sensors": {"a b": {}}}, "sensors.a b"),
        ({"sensors": {"front": {}}}, "target: 'full' is not front, the only choice"),
        ({"target": []}, "target"),
        ({"target": ["full", "full"]}, "target: a sensor repeats"),
        ({"spec": {"rows": "128"}}, "spec.rows"),
    ],
)
def test_impossible_configurations_name_the_place(value, place):
    with pytest.raises(ConfigError, match="grids.yaml: .*" + place):
        parse_config(GridConfig, value, path="grids.yaml")


def test_a_morphology_of_a_sensors_own_is_written_only_where_there_is_one():
    own = GridConfig(sensors={"full": CameraSensor(morphology="off"), "plain": CameraSensor()})
    assert (own.morphology_of("full"), own.morphology_of("plain")) == ("off", "minkowski")
    written = own.model_dump(mode="json")["sensors"]
    assert written["full"]["morphology"] == "off"
    assert "morphology" not in written["plain"]
    assert grid_digest(own) != grid_digest(GridConfig(sensors={"full": CameraSensor(), "plain": CameraSensor()}))
