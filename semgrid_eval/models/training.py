"""Training of the encoder-decoder: masked loss, RMSprop, and an exact restart after a stop."""

import hashlib
import math
import time
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self

import torch
from pydantic import Field, model_validator
from torch import Tensor
from torch.nn import functional as F

from semgrid_eval.config import Config
from semgrid_eval.errors import SemgridError
from semgrid_eval.files import digest_value, locked
from semgrid_eval.models.checkpoint import EpochRecord, TrainingFolder
from semgrid_eval.models.device import Precision, choose_precision, keep_freed_memory, seeded
from semgrid_eval.models.network import (
    EncoderDecoder,
    NetworkConfig,
    Preset,
    autocast,
    check_grid_size,
    seeded_network,
)
from semgrid_eval.progress import Progress, silent
from semgrid_eval.windows.data import WindowBatch, WindowSet

_IGNORED = -100
_REPORT_INTERVAL_S = 0.5


class TrainingConfig(Config):
    """How an ED is trained; the defaults are the paper's (readings 1 and 7).

    Args:
        updates_per_epoch: batches an epoch; with `epoch_unit: windows` it counts windows instead.
        learning_rate_drop_epoch: epochs after this many use `learning_rate_after_drop`; None keeps `learning_rate`.
        clip_norm: limit of the gradient's norm; the paper has none.
        precision: `auto` takes bfloat16 where the device multiplies in it natively.
        optimizer_preset: whose constants RMSprop, batch normalisation and initial weights follow.
    """

    epochs: int = Field(default=40, ge=1)
    updates_per_epoch: int = Field(default=185, ge=1)
    epoch_unit: Literal["batches", "windows"] = "batches"
    batch: int = Field(default=32, ge=1)
    learning_rate: float = Field(default=1e-3, gt=0)
    learning_rate_drop_epoch: int | None = Field(default=35, ge=0)
    learning_rate_after_drop: float = Field(default=1e-4, gt=0)
    optimizer_preset: Preset = "keras"
    clip_norm: float | None = Field(default=None, gt=0)
    precision: Precision = "auto"

    @model_validator(mode="after")
    def _epoch_holds_a_batch(self) -> Self:
        if self.updates_until(1) < 1:
            raise ValueError(f"an epoch of {self.updates_per_epoch} windows does not fill a batch of {self.batch}")
        return self

    def updates_until(self, epoch: int) -> int:
        """Updates made when `epoch` epochs are over; a batch that two epochs share counts for the second."""
        per_update = self.batch if self.epoch_unit == "windows" else 1
        return epoch * self.updates_per_epoch // per_update

    def learning_rate_in(self, epoch: int) -> float:
        """Learning rate of an epoch, counted from 0."""
        late = self.learning_rate_drop_epoch is not None and epoch >= self.learning_rate_drop_epoch
        return self.learning_rate_after_drop if late else self.learning_rate


class DivergedError(SemgridError):
    """The loss is no longer a number."""


@dataclass(frozen=True)
class Trained:
    """A trained network with its history.

    Args:
        seconds: time spent on updates, without validation and without what lay between a stop and a restart.
        dtype: what it was trained in and is meant to predict in.
    """

    network: EncoderDecoder
    history: tuple[EpochRecord, ...]
    seconds: float
    dtype: torch.dtype


def train(
    windows: WindowSet,
    network_config: NetworkConfig,
    training_config: TrainingConfig,
    *,
    seed: int,
    device: torch.device,
    folder: Path,
    progress: Progress = silent,
    validation: WindowSet | None = None,
) -> Trained:
    """Train an ED, or finish a training that was stopped: on one machine's CPU the weights are the same bytes.

    `folder` gets `weights.safetensors`, `history.csv` and, while it lasts, `checkpoint.pt`. A training that is
    complete there is read, not repeated. The loss over the `validation` windows is noted after each epoch.

    Raises:
        InputError: `folder` belongs to another training, is damaged or cannot be written to.
        ConfigError: the network does not fit the grids.
        DivergedError: the loss became NaN or infinite.
    """
    check_grid_size(network_config, *windows.data.grids.shape[-2:])
    key = {
        "network": network_config.model_dump(),
        "training": training_config.model_dump(),
        "seed": seed,
        "windows": windows.digest(),
        "validation": validation.digest() if validation else None,
    }
    store = TrainingFolder(folder, digest_value(key))
    dtype = choose_precision(training_config.precision, device)
    # Whoever else trains the same waits, and then finds it complete; what is complete need not be writable.
    with nullcontext() if store.is_complete() else locked(folder):
        if store.is_complete():
            network, history = store.read(device)
        else:
            network = seeded_network(
                network_config, grids=windows.grids_per_window, preset=training_config.optimizer_preset, seed=seed
            ).to(device)
            trainer = _Trainer(network, training_config, windows.to(device), seed, dtype)
            history = trainer.run(store, validation.to(device) if validation else None, progress)
    return Trained(network.eval(), tuple(history), sum(row.seconds for row in history), dtype)


def masked_loss(logits: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Cross entropy without loss inside M, the mean over all cells (reading 10).

    Logits (B, C, H, W), target (B, H, W) uint8, mask M (B, H, W) bool -> scalar. Taking the target for the prediction
    inside M, as the paper's equation does, makes the loss there zero.
    """
    counted = target.long().masked_fill(mask, _IGNORED)
    return F.cross_entropy(logits.float(), counted, ignore_index=_IGNORED, reduction="sum") / target.numel()


def draw_windows(count: int, needed: int, generator: torch.Generator) -> Tensor:
    """Draw window indices (needed,) at random; none comes again before all `count` were drawn."""
    rounds = math.ceil(needed / count)
    return torch.cat([torch.randperm(count, generator=generator) for _ in range(rounds)])[:needed]


class _Trainer:
    """Network, optimizer and windows of one training."""

    def __init__(
        self, network: EncoderDecoder, config: TrainingConfig, windows: WindowSet, seed: int, dtype: torch.dtype
    ) -> None:
        self._network = network
        self._config = config
        self._windows = windows
        self._seed = seed
        self._dtype = dtype
        self._device = windows.data.grids.device
        alpha, eps = (0.9, 1e-7) if config.optimizer_preset == "keras" else (0.99, 1e-8)
        self._optimizer = torch.optim.RMSprop(network.parameters(), lr=config.learning_rate, alpha=alpha, eps=eps)

    def run(self, store: TrainingFolder, validation: WindowSet | None, progress: Progress) -> list[EpochRecord]:
        """Train from the checkpoint, or from the beginning, to the end."""
        if self._device.type == "cpu":
            keep_freed_memory()
        history = store.restore(self._network, self._optimizer)
        for epoch in range(len(history), self._config.epochs):
            # Each epoch has a seed of its own, so that no state of a generator needs to be kept.
            with seeded(_epoch_seed(self._seed, epoch), self._device):
                started_s = time.monotonic()
                loss = self._run_epoch(epoch, progress)
                seconds = time.monotonic() - started_s
            record = EpochRecord(
                epoch=epoch + 1,
                updates=self._config.updates_until(epoch + 1),
                learning_rate=self._config.learning_rate_in(epoch),
                loss=loss,
                validation_loss=self._validation_loss(validation) if validation else None,
                seconds=round(seconds, 3),
            )
            history.append(record)
            store.keep(self._network, self._optimizer, history)
        store.finish(self._network, history)
        return history

    def _run_epoch(self, epoch: int, progress: Progress) -> float:
        """Make the updates of an epoch (counted from 0) and give their mean loss."""
        first, last = self._config.updates_until(epoch), self._config.updates_until(epoch + 1)
        for group in self._optimizer.param_groups:
            group["lr"] = self._config.learning_rate_in(epoch)
        self._network.train()
        generator = torch.Generator().manual_seed(_epoch_seed(self._seed, epoch))
        drawn = draw_windows(len(self._windows), (last - first) * self._config.batch, generator).to(self._device)
        total = torch.zeros((), device=self._device)
        said_s = time.monotonic()
        for done in range(1, last - first + 1):
            chosen = drawn[(done - 1) * self._config.batch : done * self._config.batch]
            total += self._update(self._windows.batch(chosen))
            # Reading the loss waits for the device, so it is not done after each update.
            if done == last - first or time.monotonic() - said_s > _REPORT_INTERVAL_S:
                loss = self._checked(total.item() / done, first + done)
                message = f"epoch {epoch + 1}/{self._config.epochs} loss {loss:.4f}"
                progress(first + done, self._config.updates_until(self._config.epochs), message)
                said_s = time.monotonic()
        return total.item() / (last - first)

    def _update(self, batch: WindowBatch) -> Tensor:
        with autocast(self._device, self._dtype):
            logits = self._network(batch.past)
        loss = masked_loss(logits, batch.target, batch.mask)
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        if self._config.clip_norm is not None:
            torch.nn.utils.clip_grad_norm_(self._network.parameters(), self._config.clip_norm)
        self._optimizer.step()
        return loss.detach()

    def _validation_loss(self, windows: WindowSet) -> float:
        self._network.eval()
        total = 0.0
        with torch.inference_mode(), autocast(self._device, self._dtype):
            for batch in windows.batches(self._config.batch):
                loss = masked_loss(self._network(batch.past), batch.target, batch.mask)
                total += loss.item() * len(batch.target)
        return total / len(windows)

    def _checked(self, loss: float, update: int) -> float:
        if not math.isfinite(loss):
            raise DivergedError(
                f"training diverged: the loss is {loss} after {update} updates; "
                f"try a learning_rate below {self._config.learning_rate:g} or set clip_norm"
            )
        return loss


def _epoch_seed(seed: int, epoch: int) -> int:
    digest = hashlib.sha256(f"{seed} {epoch}".encode()).digest()
    return int.from_bytes(digest[:6], "big")
