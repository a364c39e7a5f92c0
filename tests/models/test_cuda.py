"""Networks on a CUDA device: near the CPU's float32, the same bytes each time, resumed, and never waited for."""

import pytest
import torch
from support.cuda import CPU, CUDA, NEEDS_CUDA, NETWORKS, settled, windows_of
from support.models import given, network
from support.recordings import drifting_blocks

from semgrid_eval.models.augment import AugmentConfig, augment
from semgrid_eval.models.checkpoint import CHECKPOINT_FILE, WEIGHTS_FILE
from semgrid_eval.models.network import autocast
from semgrid_eval.models.registry import find_model
from semgrid_eval.models.training import train
from semgrid_eval.progress import silent

pytestmark = [*NEEDS_CUDA, pytest.mark.parametrize("name", NETWORKS), pytest.mark.usefixtures("settled")]
__all__ = ["settled"]
SIZE, EPOCHS, UPDATES = 32, 2, 10
# Small, so that loading kernels takes most of the time. Layers of zeros give gradients of rounding errors alone, which
# optimisers that divide by their size make large: a network that starts from its table is not compared.
CHANGES = AugmentConfig(flip=0.5, rotate_deg=2.0, misalign_cells=1)
SMALL = {
    "ed": {"features": 16},
    "residual": {"widths": [16, 32], "fine": 8, "shift": 1, "prior": False},
    "residual-flow": {"widths": [16, 32], "fine": 8, "prior": False},
}


def untrained(name, precision="float32", *, dropout=True):
    """Make a small network; drops differ between devices, and without them the two can be compared."""
    training = {
        "epochs": EPOCHS,
        "updates_per_epoch": UPDATES,
        "batch": 8,
        "precision": precision,
        "schedule": {"drop_epoch": 1},
    }
    made = network(find_model(name), given(size=SIZE), training=training, **SMALL.get(name, {}))
    for module in made.modules():
        if isinstance(module, torch.nn.Dropout) and not dropout:
            module.p = 0.0
    return made


def windows():
    return windows_of([drifting_blocks(seed, size=SIZE) for seed in range(6)])


def trained(name, folder, device, progress=silent, **options):
    return train(untrained(name, **options), windows(), seed=0, device=device, folder=folder, progress=progress)


def stop_after_an_epoch(done, _total, _message=""):
    if done >= UPDATES:
        raise KeyboardInterrupt


def losses(done):
    return torch.tensor([row.loss for row in done.history])


def flat_weights(done):
    return torch.cat([value.detach().cpu().flatten() for value in done.network.parameters()])


def test_answers_are_near_those_of_the_cpu(name):
    made, batch = untrained(name).eval(), windows().batch(slice(0, 8))
    expected = made.predict(batch)
    found = made.to(CUDA).predict(windows().to(CUDA).batch(slice(0, 8))).cpu()
    torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-4)


def test_trainings_are_near_those_of_the_cpu(name, tmp_path):
    here = trained(name, tmp_path / "cpu", CPU, dropout=False)
    there = trained(name, tmp_path / "cuda", CUDA, dropout=False)
    torch.testing.assert_close(losses(there), losses(here), rtol=2e-3, atol=0.0)
    mine, theirs = flat_weights(here), flat_weights(there)
    assert (mine - theirs).norm() < 0.01 * mine.norm()


@pytest.mark.parametrize("precision", ["float32", "bf16"])
def test_the_same_training_gives_the_same_bytes(name, precision, tmp_path):
    first, second = (trained(name, tmp_path / folder, CUDA, precision=precision) for folder in "ab")
    assert (tmp_path / "a" / WEIGHTS_FILE).read_bytes() == (tmp_path / "b" / WEIGHTS_FILE).read_bytes()
    assert [row[:5] for row in first.history] == [row[:5] for row in second.history]


def test_stopped_training_ends_in_the_same_bytes(name, tmp_path):
    trained(name, tmp_path / "a", CUDA, precision="bf16")
    with pytest.raises(KeyboardInterrupt):
        trained(name, tmp_path / "b", CUDA, stop_after_an_epoch, precision="bf16")
    trained(name, tmp_path / "b", CUDA, precision="bf16")
    assert (tmp_path / "a" / WEIGHTS_FILE).read_bytes() == (tmp_path / "b" / WEIGHTS_FILE).read_bytes()


@pytest.mark.parametrize(("first", "second"), [(CPU, CUDA), (CUDA, CPU)], ids=["to cuda", "and back"])
def test_a_checkpoint_goes_on_on_the_other_device(name, first, second, tmp_path):
    whole = trained(name, tmp_path / "whole", first, dropout=False)
    with pytest.raises(KeyboardInterrupt):
        trained(name, tmp_path / "moved", first, stop_after_an_epoch, dropout=False)
    assert not (tmp_path / "moved" / WEIGHTS_FILE).exists()
    moved = trained(name, tmp_path / "moved", second, dropout=False)
    torch.testing.assert_close(losses(moved), losses(whole), rtol=2e-3, atol=0.0)
    assert not (tmp_path / "moved" / CHECKPOINT_FILE).exists()


def test_no_update_waits_for_the_device(name):
    made, data = untrained(name, "bf16").to(CUDA).train(), windows().to(CUDA)
    optimizer, chosen, generator = made.optimizer(), torch.arange(8, device=CUDA), torch.Generator()

    def update():
        batch = augment(data.batch(chosen), CHANGES, generator, translate=True)
        with autocast(CUDA, torch.bfloat16):
            logits = made(batch)
        loss = made.loss(logits.float(), batch)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(made.parameters(), 1.0)
        optimizer.step()

    update()  # loads kernels
    torch.cuda.set_sync_debug_mode("error")
    try:
        update()
    finally:
        torch.cuda.set_sync_debug_mode("default")
