"""A kind of sensor that is added in one file, beside a camera in the grids of one log."""

from typing import Literal

import numpy as np
import pytest
from support.toy_world import FRAME_NS, START_NS, street

from semgrid_eval.classes import CLASS_NAMES, NO_POINT, UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.store import write_log
from semgrid_eval.sensors.kinds import KINDS
from semgrid_eval.sensors.sensor import Kind, Points, SensorConfig

PERSON = CLASS_NAMES.index("person")


class Radar(SensorConfig):
    """Sees two persons abreast at one distance, 20 ms before each frame."""

    kind: Literal["radar"] = "radar"
    ahead_m: float = 10.2


def read_radar(log, sensors, class_by_label):
    assert class_by_label.shape == (256,)
    for frame in range(3):
        for name, sensor in sensors.items():
            classes = np.array([PERSON, PERSON, NO_POINT], np.uint8)
            yield Points(
                name,
                START_NS + frame * FRAME_NS - 20_000_000,
                np.full(3, sensor.ahead_m),
                np.arange(-1.0, 2.0),
                classes,
            )


@pytest.fixture(autouse=True)
def radar(monkeypatch):
    monkeypatch.setitem(KINDS, "radar", Kind(Radar, read_radar))


def test_its_grids_stand_beside_a_cameras_moved_to_the_time_of_the_target(tmp_path):
    write_log(street(1, frames=3, speed_mps=10.0).recording(), tmp_path / "toy.mcap")
    value = {
        "sensors": {"full": {}, "near": {"kind": "radar"}, "far": {"kind": "radar", "ahead_m": 30.5}},
        "morphology": "off",
    }
    config = parse_config(GridConfig, value)
    (recording,) = build_log(tmp_path / "toy.mcap", config)
    assert recording.sensors == ("full", "near", "far")
    assert recording.target == "full"
    cell_m = config.spec.cell_m
    for row, ahead_m in ((1, 10.2), (2, 30.5)):
        for frame in range(3):
            cells = np.argwhere(recording.grids[row, frame] != UNKNOWN)
            assert cells[:, 0].tolist() == [127 - int((ahead_m - 0.2) / cell_m)] * 2, "0.2 m nearer after 20 ms"
            assert cells[:, 1].tolist() == [63, 65]


def test_it_can_make_the_target_of_a_log_and_its_settings_are_strict(tmp_path):
    write_log(street(1, frames=3).recording(), tmp_path / "toy.mcap")
    config = GridConfig(sensors={"only": Radar(ahead_m=5.0)}, target=("only",))
    (recording,) = build_log(tmp_path / "toy.mcap", config)
    assert recording.stamps_ns[0] == START_NS - 20_000_000
    assert config.camera is None
    assert parse_config(GridConfig, config.model_dump(mode="json")) == config
    with pytest.raises(ConfigError, match="top_px: unknown key; allowed here: ahead_m, kind, max_age_s"):
        parse_config(GridConfig, {"sensors": {"full": {"kind": "radar", "top_px": 3}}})
