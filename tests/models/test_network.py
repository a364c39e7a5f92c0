"""What all networks share: planes, the masked loss, optimisers and schedules by their settings, probabilities."""

from types import SimpleNamespace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field
from support.models import network
from support.planned import planned
from support.recordings import random_recording
from torch.nn import functional as F

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.encoder_decoder import EncoderDecoder
from semgrid_eval.models.model import one_hot
from semgrid_eval.models.network import (
    NetworkSettings,
    ScheduleConfig,
    TrainingConfig,
    input_planes,
    jaccard_loss,
    masked_loss,
)
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings

GRIDS = torch.randint(0, CLASS_COUNT, (2, 3, 8, 8), generator=torch.Generator().manual_seed(0), dtype=torch.uint8)


def test_planes_put_each_grids_classes_side_by_side_in_what_layers_compute_in():
    assert input_planes(GRIDS[:, :, None]).dtype == torch.float32
    with torch.autocast("cpu", dtype=torch.bfloat16):
        planes = input_planes(GRIDS[:, :, None])
    expected = F.one_hot(GRIDS.long(), CLASS_COUNT).permute(0, 1, 4, 2, 3).flatten(1, 2)
    assert planes.dtype == torch.bfloat16
    assert planes.is_contiguous(memory_format=torch.channels_last)
    assert torch.equal(planes.long(), expected)


@pytest.mark.parametrize("precision", ["float32", "bf16"])
def test_a_network_predicts_probabilities(precision):
    data = stack_recordings([random_recording(0)], cell_m=0.5)
    batch = select_windows(data, planned((0, (0, 5), 10)), sensors=["full"]).batch(slice(0, 1))
    net = network(EncoderDecoder, depth=2, features=4, training={"precision": precision}).eval()
    scores = net.predict(batch)
    assert scores.dtype == torch.float32
    torch.testing.assert_close(scores.sum(dim=1), torch.ones(1, 16, 16))


@pytest.mark.parametrize(
    ("kind", "constants", "expected"),
    [
        ("rmsprop", "keras", {"alpha": 0.9, "eps": 1e-7}),
        ("rmsprop", "torch", {"alpha": 0.99, "eps": 1e-8}),
        ("adam", "keras", {"eps": 1e-7, "betas": (0.9, 0.999)}),
        ("adam", "torch", {"eps": 1e-8, "betas": (0.9, 0.999)}),
    ],
)
def test_optimisers_have_the_constants_that_are_asked_for(kind, constants, expected):
    training = {"optimizer": {"kind": kind, "constants": constants}, "schedule": {"learning_rate": 0.5}}
    optimizer = network(EncoderDecoder, depth=2, features=4, training=training).optimizer()
    assert type(optimizer).__name__.lower() == kind
    assert optimizer.defaults.items() >= {"lr": 0.5, **expected}.items()


@given(seed=st.integers(0, 2**32 - 1), batch=st.integers(1, 3))
def test_masked_loss_equals_replacing_the_prediction_by_the_target(seed, batch):
    generator = torch.Generator().manual_seed(seed)
    logits = torch.randn(batch, CLASS_COUNT, 3, 4, generator=generator)
    target = torch.randint(0, CLASS_COUNT, (batch, 3, 4), generator=generator, dtype=torch.uint8)
    mask = torch.rand(batch, 3, 4, generator=generator) < 0.4
    total = 0.0
    for b, row, column in [(b, r, c) for b in range(batch) for r in range(3) for c in range(4)]:
        truth = torch.nn.functional.one_hot(target[b, row, column].long(), CLASS_COUNT).double()
        predicted = logits[b, :, row, column].double().softmax(dim=0)
        m = float(mask[b, row, column])
        total -= float((truth * ((1 - m) * predicted + m * truth).clamp_min(1e-300).log()).sum())
    assert masked_loss(logits, target, mask).item() == pytest.approx(total / mask.numel(), rel=1e-4, abs=1e-6)


def test_cells_inside_the_mask_get_no_gradient():
    logits = torch.randn(2, CLASS_COUNT, 4, 4, generator=torch.Generator().manual_seed(0), requires_grad=True)
    target = torch.ones(2, 4, 4, dtype=torch.uint8)
    mask = torch.zeros(2, 4, 4, dtype=torch.bool)
    mask[:, 1:3] = True
    masked_loss(logits, target, mask).backward()
    assert torch.equal(logits.grad.abs().sum(dim=1) > 0, ~mask)


def test_papers_configuration_counts_as_the_readings_say():
    paper = TrainingConfig()
    assert paper.updates_until(40) * paper.batch == 236_800
    assert [paper.rate_at(185 * epoch, epoch) for epoch in (0, 34, 35, 39)] == [1e-3, 1e-3, 1e-4, 1e-4]
    assert TrainingConfig(epoch_unit="windows").updates_until(40) == 231
    assert TrainingConfig(schedule=ScheduleConfig(drop_epoch=None)).rate_at(39 * 185, 39) == 1e-3


def test_a_cosine_rises_to_the_rate_and_falls_as_half_a_wave():
    schedule = ScheduleConfig(shape="cosine", learning_rate=0.8, warm_up=0.2)
    config = TrainingConfig(epochs=2, updates_per_epoch=10, schedule=schedule)
    rates = [config.rate_at(update, update // 10) for update in range(20)]
    assert rates[:5] == pytest.approx([0.2, 0.4, 0.6, 0.8, 0.8])
    assert rates[12] == pytest.approx(0.4)
    assert sorted(rates[4:], reverse=True) == rates[4:]
    assert 0 < rates[-1] < 0.01


def test_jaccard_loss_is_the_share_of_cells_that_both_do_not_have():
    target = torch.tensor([[[1, 1, 2, 0]]], dtype=torch.uint8)
    certain = 100 * one_hot(torch.tensor([[[1, 2, 2, 0]]], dtype=torch.uint8))
    mask = torch.tensor([[[False, False, False, True]]])
    # Class 1: one of two cells, class 2: one of two; one cell is added to both sides. Class 0 lies inside M.
    assert jaccard_loss(certain, target, mask).item() == pytest.approx(1 - (1 + 1) / (2 + 1))
    right = 100 * one_hot(target)
    assert jaccard_loss(right, target, mask).item() == pytest.approx(0, abs=1e-6)


def test_the_loss_of_a_training_is_what_its_settings_ask_for():
    logits = torch.randn(2, CLASS_COUNT, 4, 4, generator=torch.Generator().manual_seed(0))
    target = torch.randint(0, CLASS_COUNT, (2, 4, 4), dtype=torch.uint8)
    batch = SimpleNamespace(target=target, mask=torch.zeros(2, 4, 4, dtype=torch.bool))
    with_jaccard = network(EncoderDecoder, depth=2, features=4, training={"loss": {"jaccard": 0.5}})
    expected = masked_loss(logits, target, batch.mask) + 0.5 * jaccard_loss(logits, target, batch.mask)
    torch.testing.assert_close(with_jaccard.loss(logits, batch), expected)


def test_an_epoch_without_a_whole_batch_is_refused():
    with pytest.raises(ConfigError, match="an epoch of 7 windows does not fill a batch of 8"):
        parse_config(TrainingConfig, {"updates_per_epoch": 7, "batch": 8, "epoch_unit": "windows"})


def test_a_network_may_have_a_training_of_its_own_class():
    class Mine(TrainingConfig):
        extra: int = 3

    class Settings(NetworkSettings):
        training: Mine = Field(default_factory=Mine)

    found = parse_config(Settings, {"training": {"epochs": 2}})
    assert (found.training.epochs, found.training.extra, type(found.training)) == (2, 3, Mine)
