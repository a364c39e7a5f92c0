import numpy as np
import pytest
import torch
from support.disturbed import batch_of, classes_of, numbered, windows_of

from semgrid_eval.errors import ConfigError
from semgrid_eval.runs.matrix import load_matrix

INPUTS = (2, (0, 1, 2), 3)


@pytest.mark.parametrize(
    ("which", "strength", "left"),
    [
        ("newest", 1, [[1], [2], [0]]),
        ("oldest", 1, [[0], [2], [3]]),
        ("newest", 2, [[1], [0], [0]]),
        ("random", 3, [[0], [0], [0]]),
    ],
)
def test_chosen_inputs_are_unknown_for_all_sensors_and_targets_and_m_stay(which, strength, left):
    windows = windows_of([numbered(4, sensors=("full", "rear"))], [(0, (0, 1, 2), 3)], sensors=("full", "rear"))
    plain, found = batch_of(windows), batch_of(windows, kind="lost_frame", which=which, strength=strength)
    assert classes_of(found.past) == [left]
    assert torch.equal(found.past[:, 0], found.past[:, 1])
    for name in ("target", "mask", "lead_s", "shift_cells"):
        assert torch.equal(getattr(found, name), getattr(plain, name))


def test_m_is_what_the_undisturbed_inputs_saw():
    unknown = numbered(4)
    unknown.grids[:, 3] = 0
    windows = windows_of([unknown], [(0, (0, 1, 2), 3)])
    assert batch_of(windows, kind="lost_frame", strength=3).mask.all()


def test_random_inputs_are_drawn_by_window_and_seed_alone():
    recordings = [numbered(8, name=f"log {i}") for i in range(40)]
    all_of_them = windows_of(recordings, [(i, (0, 1, 2), 3) for i in range(40)])
    some = windows_of(recordings, [(i, (0, 1, 2), 3) for i in range(39, 29, -1)])
    drawn = {"kind": "lost_frame", "which": "random"}
    lost = [[0] in window and window.index([0]) for window in classes_of(batch_of(all_of_them, **drawn).past)]
    assert set(lost) == {0, 1, 2}
    again = [window.index([0]) for window in classes_of(batch_of(some, **drawn).past)]
    assert again == lost[:29:-1], "whichever windows are beside it"
    other = [window.index([0]) for window in classes_of(batch_of(all_of_them, **drawn, seed=1).past)]
    assert np.mean(np.array(other) == lost) < 0.7


def test_no_more_can_be_lost_than_there_is(tmp_path):
    (tmp_path / "m.yaml").write_text("rows: [{name: a, model: newest, disturb: {kind: lost_frame, strength: 3}}]")
    with pytest.raises(
        ConfigError, match=r"m\.yaml: row 'a': .*disturb\.strength: 3 frames cannot be lost of 2 inputs"
    ):
        load_matrix(str(tmp_path / "m.yaml"))
