"""How sure a network says it is: fitted to shares of right cells, and no predicted class changes."""

import numpy as np
import pytest
import torch
from support.recordings import random_recording

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.models.certainty import Certainty
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows


@pytest.fixture(name="windows")
def windows_fixture():
    data = stack_recordings([random_recording(1, frames=40, size=32, sensors=("full",))], cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(inputs=1, step_frames=1, target_frame=8))
    return select_windows(data, plan.windows, sensors=("full",))


def sure_answers(windows, share):
    """Answer with the target's class in `share` of the cells, another one elsewhere, each time with certainty .99."""
    generator = torch.Generator().manual_seed(3)

    def probabilities(batch):
        right = torch.rand(batch.target.shape, generator=generator) < share[batch.target.long()]
        said = torch.where(right, batch.target, (batch.target + 1) % CLASS_COUNT).long()
        sure = torch.full((len(said), CLASS_COUNT, *said.shape[1:]), 0.01 / (CLASS_COUNT - 1))
        return sure.scatter(1, said[:, None], 0.99)

    return probabilities


def test_certainty_becomes_the_share_of_right_cells_of_the_predicted_class(windows):
    share = torch.linspace(0.3, 0.9, CLASS_COUNT)
    answer = sure_answers(windows, share)
    certainty = Certainty(CLASS_COUNT)
    certainty.fit(answer, windows)
    batch = windows.batch(slice(None))
    scaled, raw = certainty(answer(batch)), answer(batch)
    highest, predicted = scaled.max(dim=1)
    for each in range(CLASS_COUNT):
        here = (predicted == each) & ~batch.mask
        right = (batch.target[here] == each).float().mean()
        assert float(highest[here].mean()) == pytest.approx(float(right), abs=0.02)
    assert float(raw.max()) == pytest.approx(0.99)


def test_the_predicted_class_stays_and_sure_cells_stay_surer(windows):
    certainty = Certainty(CLASS_COUNT)
    certainty.fit(sure_answers(windows, torch.full((CLASS_COUNT,), 0.6)), windows)
    probabilities = torch.rand(2, CLASS_COUNT, 8, 8, generator=torch.Generator().manual_seed(1)).softmax(dim=1)
    scaled = certainty(probabilities)
    np.testing.assert_array_equal(scaled.argmax(dim=1), probabilities.argmax(dim=1))
    of_class = probabilities.argmax(dim=1) == 4
    before, after = (each.amax(dim=1)[of_class] for each in (probabilities, scaled))
    assert bool((after[before.argsort()].diff() >= 0).all())


def test_a_class_that_is_never_predicted_keeps_its_certainty(windows):
    certainty = Certainty(CLASS_COUNT)
    always_third = torch.zeros(CLASS_COUNT)
    always_third[3] = 0.8

    def probabilities(batch):
        return always_third[None, :, None, None].expand(len(batch.target), -1, *batch.target.shape[1:])

    certainty.fit(probabilities, windows)
    assert (float(certainty.slope[2]), float(certainty.offset[2])) == (1.0, 0.0)
    assert float(certainty.offset[3]) != 0.0


def test_what_is_always_right_stays_finite_and_below_one(windows):
    certainty = Certainty(CLASS_COUNT)
    certainty.fit(sure_answers(windows, torch.ones(CLASS_COUNT)), windows)
    assert bool(torch.isfinite(certainty.slope).all() and torch.isfinite(certainty.offset).all())
    assert float(certainty(torch.eye(CLASS_COUNT)[:, :, None, None]).max()) <= 1.0
