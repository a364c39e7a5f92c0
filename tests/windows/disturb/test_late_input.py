from dataclasses import replace

import numpy as np
import torch
from support.disturbed import SPEC, batch_of, classes_of, numbered, windows_of

from semgrid_eval.windows.disturb.turning import turn_grids


def test_inputs_are_those_of_earlier_frames_under_their_stamps():
    recording = numbered(9, position_m=np.stack([np.arange(9.0), np.zeros(9)], axis=1))
    windows = windows_of([recording], [(0, (4, 6), 8)], translate=False)
    plain, found = batch_of(windows), batch_of(windows, kind="late_input", strength=3)
    assert classes_of(plain.past) == [[[5], [7]]]
    assert classes_of(found.past) == [[[2], [4]]]
    for name in ("target", "mask", "lead_s", "shift_cells"):
        assert torch.equal(getattr(found, name), getattr(plain, name))


def test_before_a_recording_began_nothing_had_arrived():
    windows = windows_of([numbered(4), numbered(9, name="two")], [(1, (1, 2), 5)], translate=False)
    assert classes_of(batch_of(windows, kind="late_input", strength=2).past) == [[[0], [1]]]


def test_what_is_late_is_placed_by_the_heading_of_its_stamp():
    random = np.random.default_rng(0)
    recording = numbered(5)
    recording.grids[:] = random.integers(0, 10, recording.grids.shape, dtype=np.uint8)
    yaw_rad = np.array([0.0, 0.1, 0.3, 0.6, 1.0])
    windows = windows_of([replace(recording, yaw_rad=yaw_rad)], [(0, (1, 3), 4)], translate=False)
    found = batch_of(windows, kind="late_input", strength=1).past
    seen = torch.from_numpy(np.ascontiguousarray(recording.grids[None, :, [0, 2]]))
    assert torch.equal(found, turn_grids(seen, np.array([[0.1, 0.3]]), SPEC))
