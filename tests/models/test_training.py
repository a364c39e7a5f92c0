"""Training: the masked loss, what is learnt, and that a stopped training ends in the same bytes."""

import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from support.recordings import drifting_blocks

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.models.checkpoint import CHECKPOINT_FILE, HISTORY_FILE, WEIGHTS_FILE
from semgrid_eval.models.network import NetworkConfig, NetworkPredictor, load_network
from semgrid_eval.models.training import DivergedError, TrainingConfig, draw_windows, masked_loss, train
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

CPU = torch.device("cpu")
NETWORK = NetworkConfig(depth=2, features=4)
QUICK = TrainingConfig(epochs=3, updates_per_epoch=3, batch=4, learning_rate_drop_epoch=2, precision="float32")


def windows_of(*seeds):
    data = stack_recordings([drifting_blocks(seed) for seed in seeds], cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(step_frames=2))
    return select_windows(data, plan.windows, sensors=["full"])


def quick(folder, *, windows=None, config=QUICK, seed=1, **options):
    windows = windows or windows_of(0, 1, 2)
    return train(windows, NETWORK, config, seed=seed, device=CPU, folder=folder, **options)


class StopAfter:
    """Progress that stops the training at its n-th call."""

    def __init__(self, calls):
        self.calls = calls

    def __call__(self, done, total, message=""):
        self.calls -= 1
        if self.calls == 0:
            raise KeyboardInterrupt


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


@pytest.mark.parametrize("precision", ["float32", "bf16"])
def test_network_learns_a_car_that_drives_right(tmp_path, precision):
    windows = windows_of(0, 1, 2, 3)
    config = TrainingConfig(epochs=6, updates_per_epoch=50, batch=8, learning_rate_drop_epoch=4, precision=precision)
    trained = train(windows, NetworkConfig(depth=2, features=8), config, seed=0, device=CPU, folder=tmp_path)
    assert trained.history[-1].loss < 0.2 * trained.history[0].loss
    batch = windows.batch(slice(None))
    newest = batch.past[:, 0, -1].long()
    predicted = NetworkPredictor(trained.network, trained.dtype)(batch).argmax(dim=1)
    moved = newest != batch.target.long()
    assert (predicted == batch.target)[moved].float().mean() > 0.8


@pytest.mark.parametrize("calls", [1, 2, 3])
def test_stopped_training_ends_in_the_same_bytes(tmp_path, calls):
    straight, stopped = tmp_path / "straight", tmp_path / "stopped"
    config = QUICK.model_copy(update={"clip_norm": 1.0})
    whole = quick(straight, config=config)
    with pytest.raises(KeyboardInterrupt):
        quick(stopped, config=config, progress=StopAfter(calls))
    assert not (stopped / WEIGHTS_FILE).exists()
    finished = quick(stopped, config=config)
    assert (straight / WEIGHTS_FILE).read_bytes() == (stopped / WEIGHTS_FILE).read_bytes()
    assert [row[:5] for row in whole.history] == [row[:5] for row in finished.history]
    assert not (stopped / CHECKPOINT_FILE).exists()


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
    grids = windows_of(5).batch(slice(None)).past
    assert torch.equal(again.network(grids), first.network(grids))
    assert torch.equal(load_network(tmp_path / WEIGHTS_FILE)(grids), first.network(grids))


def test_folder_of_another_training_is_refused(tmp_path):
    quick(tmp_path)
    with pytest.raises(InputError, match=r"weights\.safetensors: belongs to another training"):
        quick(tmp_path, seed=2)
    (tmp_path / WEIGHTS_FILE).unlink()
    with pytest.raises(KeyboardInterrupt):
        quick(tmp_path, progress=StopAfter(2))
    with pytest.raises(InputError, match=r"checkpoint\.pt: belongs to another training"):
        quick(tmp_path, windows=windows_of(7))


def test_damaged_checkpoint_is_named(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        quick(tmp_path, progress=StopAfter(2))
    path = tmp_path / CHECKPOINT_FILE
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match=r"checkpoint\.pt: is damaged; delete it"):
        quick(tmp_path)


def test_history_has_a_row_for_each_epoch(tmp_path):
    quick(tmp_path, validation=windows_of(9))
    history = pd.read_csv(tmp_path / HISTORY_FILE)
    assert list(history.columns) == ["epoch", "updates", "learning_rate", "loss", "validation_loss", "seconds"]
    assert history["epoch"].tolist() == [1, 2, 3]
    assert history["updates"].tolist() == [3, 6, 9]
    assert history["learning_rate"].tolist() == [1e-3, 1e-3, 1e-4]
    assert history["validation_loss"].notna().all()
    quick(tmp_path / "without")
    assert pd.read_csv(tmp_path / "without" / HISTORY_FILE)["validation_loss"].isna().all()


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
    config = QUICK.model_copy(update={"learning_rate": 1e30})
    with pytest.raises(DivergedError, match=r"training diverged: the loss is (nan|inf) after \d+ updates; try"):
        quick(tmp_path, config=config)


def test_papers_configuration_counts_as_the_readings_say():
    paper = TrainingConfig()
    assert paper.updates_until(40) * paper.batch == 236_800
    assert [paper.learning_rate_in(epoch) for epoch in (0, 34, 35, 39)] == [1e-3, 1e-3, 1e-4, 1e-4]
    assert TrainingConfig(epoch_unit="windows").updates_until(40) == 231
    assert TrainingConfig(learning_rate_drop_epoch=None).learning_rate_in(39) == 1e-3


def test_epochs_that_share_batches_make_every_update_once(tmp_path):
    config = TrainingConfig(epochs=3, updates_per_epoch=7, batch=4, epoch_unit="windows", precision="float32")
    assert [row.updates for row in quick(tmp_path, config=config).history] == [1, 3, 5]
    with pytest.raises(ConfigError, match="an epoch of 7 windows does not fill a batch of 8"):
        parse_config(TrainingConfig, {"updates_per_epoch": 7, "batch": 8, "epoch_unit": "windows"})


@given(count=st.integers(1, 9), needed=st.integers(1, 30), seed=st.integers(0, 1000))
def test_no_window_comes_again_before_all_were_drawn(count, needed, seed):
    drawn = draw_windows(count, needed, torch.Generator().manual_seed(seed)).tolist()
    assert len(drawn) == needed
    for start in range(0, needed, count):
        part = drawn[start : start + count]
        assert len(set(part)) == len(part)
    assert set(drawn) <= set(range(count))


def test_network_that_does_not_fit_the_grids_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="depth 6 needs grids of a multiple of 32 cells, not 16 x 16"):
        train(windows_of(0), NetworkConfig(depth=6), QUICK, seed=0, device=CPU, folder=tmp_path)
