import pytest
import torch
from support.disturbed import batch_of, numbered, settings, windows_of

from semgrid_eval.errors import ConfigError
from semgrid_eval.runs.matrix import load_matrix

SENSORS = ("full", "rear", "lidar")


def windows(count=1):
    recordings = [numbered(4, sensors=SENSORS, name=f"log {i}") for i in range(count)]
    return windows_of(recordings, [(i, (0, 1, 2), 3) for i in range(count)], sensors=("lidar", "full", "rear"))


@pytest.mark.parametrize("lost", [["lidar"], ["full", "rear"]])
def test_all_inputs_of_the_lost_sensors_are_unknown_and_the_rest_stays(lost):
    plain, found = batch_of(windows()), batch_of(windows(), kind="lost_sensor", sensors=lost)
    for row, name in enumerate(found.sensors):
        expected = torch.zeros_like(plain.past[:, row]) if name in lost else plain.past[:, row]
        assert torch.equal(found.past[:, row], expected), name
    for name in ("target", "mask", "lead_s", "shift_cells"):
        assert torch.equal(getattr(found, name), getattr(plain, name))


def test_a_share_of_the_windows_loses_them_and_it_is_the_same_share_again():
    disturb = {"kind": "lost_sensor", "sensors": ["rear"], "strength": 0.3}
    lost = [(batch_of(windows(60), **disturb).past[:, 2] == 0).all(dim=(1, 2, 3)) for _ in range(2)]
    assert 0.15 < lost[0].float().mean() < 0.45
    assert torch.equal(*lost)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sensors": ["lidar"]}, "lidar lost"),
        ({"sensors": ["left", "rear", "lidar"]}, "left, rear and lidar lost"),
        ({"sensors": ["lidar"], "strength": 0.25}, "lidar lost in 25% of the windows"),
    ],
)
def test_the_words_name_what_is_lost(changes, words):
    assert settings(kind="lost_sensor", **changes).words == words


def test_a_sensor_that_the_row_does_not_have_cannot_be_lost(tmp_path):
    row = "{name: a, model: fuse, sensors: [full], disturb: {kind: lost_sensor, sensors: [split1_upper]}}"
    (tmp_path / "m.yaml").write_text(f"rows: [{row}]")
    with pytest.raises(ConfigError, match=r"m\.yaml: row 'a': .*disturb\.sensors: 'split1_upper' is not .*full"):
        load_matrix(str(tmp_path / "m.yaml"))
