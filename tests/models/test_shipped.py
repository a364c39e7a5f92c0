"""The network that comes with the package: small, sealed, for what it was trained on, told the lead."""

import hashlib
from dataclasses import replace
from importlib import resources

import pytest
import torch
from support.models import given, made
from support.recordings import random_recording

from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.models.checkpoint import read_header
from semgrid_eval.models.registry import find_model
from semgrid_eval.models.shipped import CELL_M, WEIGHTS, TownResidual
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows


@pytest.fixture(scope="module")
def batch():
    data = stack_recordings([random_recording(0, frames=5, size=24)], cell_m=CELL_M)
    plan = training_windows(data.frame_counts, WindowConfig(step_frames=1))
    return select_windows(data, plan.windows, sensors=("full",)).batch(slice(2))


def test_the_file_is_small_and_sealed_and_says_what_it_is():
    path = resources.files("semgrid_eval") / WEIGHTS.as_posix()
    assert path.stat().st_size <= 2_500_000
    header = read_header(path)
    assert header["model"] == "Residual"
    assert header["settings"]["lead_input"]
    # Results made with other weights have other ids.
    assert TownResidual.version == hashlib.sha256(path.read_bytes()).hexdigest()[:8]


def test_it_answers_by_name_with_scores_that_depend_on_the_lead(batch):
    model = made(find_model("residual-town"), given(size=24, cell_m=CELL_M)).eval()
    answers = [model.predict(replace(batch, lead_s=batch.lead_s + later)) for later in (0.0, 0.6)]
    assert 0 < float(answers[0].amax(dim=1).min()) <= float(answers[0].max()) < 1
    assert torch.equal(answers[0].argmax(dim=1), model.network.probabilities(batch).argmax(dim=1))
    assert bool((model.network.certainty.slope < 1).all()), "a network with the Jaccard loss is too sure of itself"
    assert not torch.equal(*answers)
    assert torch.equal(answers[0], model.predict(batch))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"inputs": 3}, "was trained on 2 inputs of one sensor, not 1 sensor and 3 inputs"),
        ({"sensors": ("a", "b")}, "not 2 sensors and 2 inputs"),
        ({"translate": False}, "was trained on inputs moved to the target's time"),
        ({"cell_m": 0.39}, "was trained on cells of 0.78125 m, not 0.39 m"),
    ],
)
def test_what_it_was_not_trained_on_is_refused(changes, fault):
    row = given(**{"size": 24, "cell_m": CELL_M, **changes})
    with pytest.raises(ConfigError, match=fault):
        TownResidual.check(TownResidual.parse_settings({}), row)


def test_a_longer_lead_than_it_was_trained_on_is_refused(batch):
    model = made(TownResidual, given(size=24, cell_m=CELL_M)).eval()
    with pytest.raises(InputError, match=r"was trained on leads up to 1\.25 s, not 2\.00 s"):
        model.predict(replace(batch, lead_s=torch.full_like(batch.lead_s, 2.0)))


def test_it_learns_nothing():
    assert not TownResidual.learns()
