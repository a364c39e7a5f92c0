"""The counted table: against a slow twin, its leaning on fewer grids, and a rule that it can learn."""

from collections import Counter

import numpy as np
import pytest
import torch
from support.models import given, made
from support.recordings import drifting_blocks, random_recording, recording

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.models import table as table_module
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.table import GRID_LIMIT, SMOOTHING_CELLS, ClassTable
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows


def windows_of(*recordings, sensors=("full",), inputs=2):
    data = stack_recordings(recordings, cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(inputs=inputs, step_frames=2))
    return select_windows(data, plan.windows, sensors=sensors)


def counted(windows):
    table = made(ClassTable, given(sensors=windows.sensors, inputs=windows.inputs.shape[1]))
    table.fit(windows)
    return table


def slow_probability(windows, context, target):
    """Count with dictionaries; `context` has the newest grid's class first."""
    batch = windows.batch(slice(None))
    newest_first = batch.past.numpy()[:, :, ::-1].transpose(0, 3, 4, 2, 1)  # (B, H, W, T, S)
    cells = [
        (tuple(newest_first[index].ravel()), int(batch.target[index]))
        for index in np.ndindex(*batch.target.shape)
        if not batch.mask[index]
    ]
    probability = 1 / CLASS_COUNT
    for known in range(len(context) + 1):
        seen = Counter(label for classes, label in cells if classes[:known] == context[:known])
        probability = (seen[target] + SMOOTHING_CELLS * probability) / (sum(seen.values()) + SMOOTHING_CELLS)
    return probability


@pytest.mark.parametrize("sensors", [("full",), ("lower", "full")])
def test_table_equals_counting_cell_by_cell(sensors, monkeypatch):
    monkeypatch.setattr(table_module, "BATCH", 2)
    windows = windows_of(random_recording(1, frames=7, size=8, sensors=("full", "lower")), sensors=sensors)
    table = counted(windows)
    batch = windows.batch(slice(0, 1))
    scores = table.predict(batch)
    torch.testing.assert_close(scores.sum(dim=1), torch.ones(1, 8, 8))
    for row, column, target in [(0, 0, 0), (3, 4, 7), (7, 7, 2)]:
        context = tuple(batch.past[0, :, :, row, column].flip(1).T.flatten().tolist())
        expected = slow_probability(windows, context, target)
        assert scores[0, target, row, column].item() == pytest.approx(expected, rel=1e-5)


def test_table_learns_that_a_blinking_cell_comes_back():
    grids = np.ones((1, 12, 8, 8), np.uint8)
    grids[0, ::4, 4] = grids[0, 1::4, 4] = 5  # with a step of 2 frames: there, gone, there, ...
    windows = windows_of(*[recording(grids, name=str(number)) for number in range(4)])
    batch = windows.batch(slice(None))
    assert torch.equal(counted(windows).predict(batch).argmax(dim=1), batch.target.long())
    assert not torch.equal(made(RepeatNewest).predict(batch).argmax(dim=1), batch.target.long())


def test_cells_inside_the_mask_do_not_count():
    grids = np.ones((1, 5, 8, 8), np.uint8)
    grids[0, 4] = 0  # the target is unknown where the inputs were known: all of it is M
    windows = windows_of(recording(grids))
    assert windows.batch(slice(None)).mask.all()
    torch.testing.assert_close(counted(windows).predict(windows.batch(slice(None))), torch.full((1, 10, 8, 8), 0.1))


def test_long_inputs_are_cut_to_the_newest():
    windows = windows_of(drifting_blocks(0, frames=30), inputs=GRID_LIMIT + 2)
    assert counted(windows).predict(windows.batch(slice(0, 3))).shape == (3, CLASS_COUNT, 16, 16)
