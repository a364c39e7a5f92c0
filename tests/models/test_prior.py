"""The counted table that a network starts from: against a slow twin, and what age and lead do."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import torch
from support.models import given
from support.recordings import random_recording

from semgrid_eval.classes import CLASS_COUNT, UNKNOWN
from semgrid_eval.models import prior as prior_module
from semgrid_eval.models.prior import FLOOR, SMOOTHING_CELLS, CellPrior
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows


def windows_of(*sensors, inputs=3):
    data = stack_recordings([random_recording(1, frames=9, size=8, sensors=("full", "lower"))], cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(inputs=inputs, step_frames=2, target_frame=8))
    return select_windows(data, plan.windows, sensors=sensors)


def evidence(cells):
    """Say what a cell's classes (T, S) show, walking back in time: newest known class, its age, the one before it."""
    walked = list(cells[::-1].ravel())
    known = [(age, each) for age, each in enumerate(walked) if each != UNKNOWN]
    (age, newest), before = known[0] if known else (0, UNKNOWN), known[1][1] if len(known) > 1 else UNKNOWN
    return int(newest), int(age), int(before)


def slow_logits(windows):
    batch = windows.batch(slice(None))
    cells = batch.past.numpy().transpose(0, 3, 4, 2, 1)  # (B, H, W, T, S)
    counts = Counter(
        (evidence(cells[index]), int(batch.target[index]))
        for index in np.ndindex(*batch.target.shape)
        if not batch.mask[index]
    )
    rows = {}
    for index in np.ndindex(*batch.target.shape):
        seen = evidence(cells[index])
        if seen not in rows:
            logs = np.log([counts[seen, target] + SMOOTHING_CELLS for target in range(CLASS_COUNT)])
            rows[seen] = np.maximum(logs - logs.max(), FLOOR)
    return np.array([rows[evidence(cells[index])] for index in np.ndindex(*batch.target.shape)])


@pytest.mark.parametrize("sensors", [("full",), ("lower", "full")])
def test_the_table_equals_counting_cell_by_cell(sensors, monkeypatch):
    monkeypatch.setattr(prior_module, "_BATCH", 2)
    windows = windows_of(*sensors)
    prior = CellPrior(given(sensors=sensors, inputs=3))
    prior.count(windows)
    answer = prior(windows.batch(slice(None))).permute(0, 2, 3, 1).reshape(-1, CLASS_COUNT)
    np.testing.assert_allclose(answer.detach().numpy(), slow_logits(windows), rtol=1e-5, atol=1e-6)


def test_a_table_by_lead_tells_leads_apart_and_takes_the_last_part_for_longer_ones():
    windows = windows_of("full")
    prior = CellPrior(given(inputs=3), lead_bins=4, lead_span_s=1.0)
    prior.count(windows)
    batch = windows.batch(slice(1))
    asked = {lead: replace(batch, lead_s=torch.full_like(batch.lead_s, lead)) for lead in (0.1, 0.6, 0.9, 7.0)}
    answers = {lead: prior(each) for lead, each in asked.items()}
    # All windows have one lead, so that three of the four parts were never counted.
    counted = float(windows.lead_s[0, -1])
    assert [bool(answers[lead].any()) for lead in (0.1, 0.6, 0.9)] == [
        int(4 * lead) == min(3, int(4 * counted)) for lead in (0.1, 0.6, 0.9)
    ]
    assert torch.equal(answers[7.0], answers[0.9])


def test_at_most_so_many_windows_are_counted_and_they_are_spread(monkeypatch):
    monkeypatch.setattr(prior_module, "COUNTED_WINDOWS", 2)
    windows = windows_of("full")
    picked = [0, len(windows) - 1]
    few, all_of_them = CellPrior(given(inputs=3)), CellPrior(given(inputs=3))
    few.count(windows)
    chosen = torch.tensor(picked)
    names = ("inputs", "target_frames", "shift_cells", "lead_s")
    all_of_them.count(replace(windows, **{name: getattr(windows, name)[chosen] for name in names}))
    assert torch.equal(few.table, all_of_them.table)
