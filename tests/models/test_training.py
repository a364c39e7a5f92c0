"""Training: the masked loss, what is learnt, and that a stopped training ends in the same bytes."""

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from support.models import network
from support.recordings import drifting_blocks

from semgrid_eval.errors import InputError
from semgrid_eval.models.checkpoint import CHECKPOINT_FILE, HISTORY_FILE, WEIGHTS_FILE, load_weights
from semgrid_eval.models.encoder_decoder import EncoderDecoder
from semgrid_eval.models.network import Network, input_planes
from semgrid_eval.models.training import DivergedError, draw_windows, train
from semgrid_eval.progress import silent
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

CPU = torch.device("cpu")
QUICK = {"epochs": 3, "updates_per_epoch": 3, "batch": 4, "schedule": {"drop_epoch": 2}, "precision": "float32"}

AUGMENT = {"flip": 0.5, "rotate_deg": 5.0, "misalign_cells": 1}


def windows_of(*seeds):
    data = stack_recordings([drifting_blocks(seed) for seed in seeds], cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(step_frames=2))
    return select_windows(data, plan.windows, sensors=["full"])


def quick(folder, *, windows=None, seed=1, progress=silent, validation=None, **training):
    untrained = network(EncoderDecoder, seed=seed, depth=2, features=4, training=QUICK | training)
    windows = windows or windows_of(0, 1, 2)
    return train(untrained, windows, seed=seed, device=CPU, folder=folder, progress=progress, validation=validation)


class StopAfter:
    """Progress that stops the training at the end of its n-th epoch of `QUICK`, however slow the machine is."""

    def __init__(self, epochs):
        self.updates = epochs * QUICK["updates_per_epoch"]

    def __call__(self, done, total, message=""):
        if done >= self.updates:
            raise KeyboardInterrupt


@pytest.mark.parametrize("precision", ["float32", "bf16"])
@pytest.mark.slow
def test_network_learns_a_car_that_drives_right(tmp_path, precision):
    windows = windows_of(0, 1, 2, 3)
    training = {"epochs": 6, "updates_per_epoch": 50, "batch": 8, "schedule": {"drop_epoch": 4}, "precision": precision}
    untrained = network(EncoderDecoder, depth=2, features=8, training=training)
    trained = train(untrained, windows, seed=0, device=CPU, folder=tmp_path)
    assert trained.history[-1].loss < 0.2 * trained.history[0].loss
    batch = windows.batch(slice(None))
    newest = batch.past[:, 0, -1].long()
    predicted = trained.network.predict(batch).argmax(dim=1)
    moved = newest != batch.target.long()
    assert (predicted == batch.target)[moved].float().mean() > 0.8


@pytest.mark.parametrize("epochs", [1, 2, 3])
def test_stopped_training_ends_in_the_same_bytes(tmp_path, epochs):
    straight, stopped = tmp_path / "straight", tmp_path / "stopped"
    whole = quick(straight, clip_norm=1.0)
    with pytest.raises(KeyboardInterrupt):
        quick(stopped, clip_norm=1.0, progress=StopAfter(epochs))
    assert not (stopped / WEIGHTS_FILE).exists()
    finished = quick(stopped, clip_norm=1.0)
    assert (straight / WEIGHTS_FILE).read_bytes() == (stopped / WEIGHTS_FILE).read_bytes()
    assert [row[:5] for row in whole.history] == [row[:5] for row in finished.history]
    assert not (stopped / CHECKPOINT_FILE).exists()


def test_a_stopped_training_on_changed_batches_ends_in_the_same_bytes(tmp_path):
    straight, stopped, plain = tmp_path / "straight", tmp_path / "stopped", tmp_path / "plain"
    quick(straight, augment=AUGMENT)
    with pytest.raises(KeyboardInterrupt):
        quick(stopped, augment=AUGMENT, progress=StopAfter(2))
    quick(stopped, augment=AUGMENT)
    quick(plain)
    weights = [(folder / WEIGHTS_FILE).read_bytes() for folder in (straight, stopped, plain)]
    assert weights[0] == weights[1] != weights[2]


def test_seed_decides_weights(tmp_path):
    quick(tmp_path / "a", seed=1)
    quick(tmp_path / "b", seed=1)
    quick(tmp_path / "c", seed=2)
    a, b, c = ((tmp_path / name / WEIGHTS_FILE).read_bytes() for name in "abc")
    assert a == b != c


def test_complete_training_is_read_and_not_repeated(tmp_path):
    first = quick(tmp_path)
    again = quick(tmp_path, progress=StopAfter(1))
    assert again.history == first.history
    assert again.seconds == first.seconds
    batch = windows_of(5).batch(slice(None))
    assert torch.equal(again.network(batch), first.network(batch))
    other = network(EncoderDecoder, seed=7, depth=2, features=4).eval()
    load_weights(other, tmp_path / WEIGHTS_FILE)
    assert torch.equal(other(batch), first.network(batch))


def test_folder_of_another_training_is_refused(tmp_path):
    quick(tmp_path)
    with pytest.raises(InputError, match=r"history\.csv: belongs to another id"):
        quick(tmp_path, seed=2)
    (tmp_path / WEIGHTS_FILE).unlink()
    with pytest.raises(KeyboardInterrupt):
        quick(tmp_path, progress=StopAfter(2))
    with pytest.raises(InputError, match=r"checkpoint\.pt: belongs to another id"):
        quick(tmp_path, windows=windows_of(7))


def flip(path, at, bit=0):
    content = bytearray(path.read_bytes())
    content[at % len(content)] ^= 1 << bit
    path.write_bytes(content)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", [CHECKPOINT_FILE, WEIGHTS_FILE, HISTORY_FILE])
def test_a_training_with_a_flipped_bit_is_made_again_alike_and_a_line_says_so(tmp_path, caplog, name, seed):
    if name == CHECKPOINT_FILE:
        with pytest.raises(KeyboardInterrupt):
            quick(tmp_path, progress=StopAfter(2))
    else:
        quick(tmp_path)
    rng = np.random.default_rng(seed)
    flip(tmp_path / name, int(rng.integers(1 << 40)), int(rng.integers(8)))
    quick(tmp_path)
    quick(tmp_path / "whole")
    assert (tmp_path / WEIGHTS_FILE).read_bytes() == (tmp_path / "whole" / WEIGHTS_FILE).read_bytes()
    assert [record.getMessage() for record in caplog.records if f"{name}: is damaged" in record.getMessage()]


def test_history_has_a_row_for_each_epoch(tmp_path):
    quick(tmp_path, validation=windows_of(9))
    history = pd.read_csv(tmp_path / HISTORY_FILE, comment="#")
    assert list(history.columns) == ["epoch", "updates", "learning_rate", "loss", "validation_loss", "seconds"]
    assert history["epoch"].tolist() == [1, 2, 3]
    assert history["updates"].tolist() == [3, 6, 9]
    assert history["learning_rate"].tolist() == [1e-3, 1e-3, 1e-4]
    assert history["validation_loss"].notna().all()
    quick(tmp_path / "without")
    assert pd.read_csv(tmp_path / "without" / HISTORY_FILE, comment="#")["validation_loss"].isna().all()


def test_validation_leaves_the_weights_alone(tmp_path):
    with_it, without = quick(tmp_path / "a", validation=windows_of(9)), quick(tmp_path / "b")
    state = without.network.state_dict()
    assert all(torch.equal(value, state[name]) for name, value in with_it.network.state_dict().items())


def test_progress_counts_updates_to_the_end(tmp_path):
    calls = []
    quick(tmp_path, progress=lambda done, total, message="": calls.append((done, total, message.split(" loss")[0])))
    assert calls[-1] == (9, 9, "epoch 3/3")
    assert {done for done, _, _ in calls} >= {3, 6, 9}


def test_divergence_is_told_with_what_to_change(tmp_path):
    with pytest.raises(DivergedError, match=r"training diverged: the loss is not finite in epoch \d+; try"):
        quick(tmp_path, schedule={"learning_rate": 1e30})


def test_epochs_that_share_batches_make_every_update_once(tmp_path):
    assert [row.updates for row in quick(tmp_path, updates_per_epoch=7, epoch_unit="windows").history] == [1, 3, 5]


class Shifted(Network):
    """Three lines of layers, and a loss and an optimiser of its own."""

    family = "own"

    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.layer = torch.nn.Conv2d(given.planes, 10, 3, padding=1)

    def forward(self, batch):
        return self.layer(input_planes(batch.past))

    def loss(self, logits, batch):
        return 5.0 + super().loss(logits, batch)

    def optimizer(self):
        return torch.optim.SGD(self.parameters(), lr=self.training_config.schedule.learning_rate, momentum=0.9)


def test_any_network_is_trained_with_its_own_loss_and_optimiser(tmp_path):
    def trained(folder, progress=silent):
        training = QUICK | {"schedule": {"learning_rate": 0.1, "drop_epoch": None}}
        untrained = network(Shifted, training=training)
        return train(untrained, windows_of(0), seed=0, device=CPU, folder=folder, progress=progress)

    whole = trained(tmp_path / "a")
    losses = [row.loss for row in whole.history]
    assert losses == sorted(losses, reverse=True)
    assert all(5.0 < loss < 8.0 for loss in losses)
    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path / "b", StopAfter(2))
    assert [row.loss for row in trained(tmp_path / "b").history] == losses  # the momentum, too, is in the checkpoint
    assert (tmp_path / "a" / WEIGHTS_FILE).read_bytes() == (tmp_path / "b" / WEIGHTS_FILE).read_bytes()


@given(count=st.integers(1, 9), needed=st.integers(1, 30), seed=st.integers(0, 1000))
def test_no_window_comes_again_before_all_were_drawn(count, needed, seed):
    drawn = draw_windows(count, needed, torch.Generator().manual_seed(seed)).tolist()
    assert len(drawn) == needed
    for start in range(0, needed, count):
        part = drawn[start : start + count]
        assert len(set(part)) == len(part)
    assert set(drawn) <= set(range(count))
