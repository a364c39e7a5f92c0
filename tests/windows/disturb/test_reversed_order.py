import numpy as np
import pytest
import torch
from support.disturbed import batch_of, classes_of, numbered, windows_of

from semgrid_eval.errors import ConfigError
from semgrid_eval.runs.matrix import load_matrix


def test_inputs_come_newest_first_each_in_its_own_place():
    recording = numbered(5, position_m=np.stack([np.arange(5.0) ** 2, np.zeros(5)], axis=1))
    windows = windows_of([recording], [(0, (0, 1, 2), 4)])
    plain, found = batch_of(windows), batch_of(windows, kind="reversed_order")
    assert torch.equal(found.past, plain.past.flip(2))
    assert torch.equal(found.lead_s, plain.lead_s.flip(1))
    assert torch.equal(found.shift_cells, plain.shift_cells.flip(1))
    assert torch.equal(found.mask, plain.mask)


def test_a_share_of_the_windows_is_reversed():
    recordings = [numbered(4, name=f"log {i}") for i in range(60)]
    windows = windows_of(recordings, [(i, (0, 1), 3) for i in range(60)])
    found = classes_of(batch_of(windows, kind="reversed_order", strength=0.3).past)
    assert {str(each) for each in found} == {"[[1], [2]]", "[[2], [1]]"}
    assert 8 <= sum(each == [[2], [1]] for each in found) <= 28


def test_one_input_has_no_order(tmp_path):
    row = "{name: a, model: newest, window: {inputs: 1}, disturb: {kind: reversed_order}}"
    (tmp_path / "m.yaml").write_text(f"rows: [{row}]")
    with pytest.raises(ConfigError, match="one input has no order"):
        load_matrix(str(tmp_path / "m.yaml"))
