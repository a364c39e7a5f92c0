"""The one loop that trains: any network with its loss, and an exact restart after a stop."""

import hashlib
import math
import time
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from semgrid_eval.config import Config
from semgrid_eval.errors import SemgridError
from semgrid_eval.files import digest_value, locked
from semgrid_eval.models.augment import augment
from semgrid_eval.models.checkpoint import EpochRecord, TrainingFolder
from semgrid_eval.models.device import seeded
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import Network, autocast
from semgrid_eval.progress import Progress, silent
from semgrid_eval.windows.data import WindowBatch, WindowSet

_REPORT_INTERVAL_S = 0.5


class DivergedError(SemgridError):
    """The loss is no longer a number."""


@dataclass(frozen=True)
class Trained:
    """A trained network with its history, and the time spent on updates, without validation and interruptions."""

    network: Network
    history: tuple[EpochRecord, ...]
    seconds: float


def train(
    network: Network,
    windows: WindowSet,
    *,
    seed: int,
    device: torch.device,
    folder: Path,
    progress: Progress = silent,
    validation: WindowSet | None = None,
) -> Trained:
    """Train a network, or finish a training that was stopped: on one machine's CPU the weights are the same bytes.

    `folder` gets `weights.safetensors`, `history.csv` and, while it lasts, `checkpoint.pt`. A training that is
    complete there is read, not repeated. The loss over the `validation` windows is noted after each epoch. The network
    is untrained, as `seeded_network` makes it with this seed; it is moved to the device and trained itself.

    Raises:
        InputError: `folder` belongs to another training, is damaged or cannot be written to.
        DivergedError: the loss became NaN or infinite.
    """
    network.to(device)
    key = training_key(type(network), network.settings, network.given, seed, windows, validation)
    store = TrainingFolder(folder, key)
    # Whoever else trains the same waits, and then finds it complete; what is complete need not be writable.
    with nullcontext() if store.is_complete() else locked(folder):
        if store.is_complete():
            history = store.read(network)
        else:
            trainer = _Trainer(network, windows.to(device), seed, device)
            history = trainer.run(store, validation.to(device) if validation else None, progress)
    return Trained(network.eval(), tuple(history), sum(row.seconds for row in history))


def training_key(
    made: type[Network], settings: Config, given: Given, seed: int, windows: WindowSet, validation: WindowSet | None
) -> str:
    """Digest what decides a training but for where it is done: device, precision and threads."""
    return digest_value(
        {
            "network": [made.__name__, made.version, settings.model_dump(mode="json")],
            "given": given.described(),
            "seed": seed,
            "windows": windows.digest(),
            "validation": validation.digest() if validation else None,
        }
    )


def draw_windows(count: int, needed: int, generator: torch.Generator) -> Tensor:
    """Draw window indices (needed,) at random; none comes again before all `count` were drawn."""
    rounds = math.ceil(needed / count)
    drawn = torch.cat([torch.randperm(count, generator=generator) for _ in range(rounds)])
    return drawn[:needed].clone()  # without what is not needed


class _Trainer:
    """Network, optimizer and windows of one training."""

    def __init__(self, network: Network, windows: WindowSet, seed: int, device: torch.device) -> None:
        self._network, self._windows, self._seed, self._device = network, windows, seed, device
        self._config = network.training_config
        self._dtype = network.dtype_on(device)
        self._optimizer = network.optimizer()

    def run(self, store: TrainingFolder, validation: WindowSet | None, progress: Progress) -> list[EpochRecord]:
        """Train from the checkpoint, or from the beginning, to the end."""
        history = store.restore(self._network, self._optimizer)
        if not history:
            self._network.prepare(self._windows)
        for epoch in range(len(history), self._config.epochs):
            # Each epoch has a seed of its own, so that no state of a generator needs to be kept.
            with seeded(_epoch_seed(self._seed, epoch), self._device):
                started_s = time.monotonic()
                loss = self._run_epoch(epoch, progress)
                seconds = round(time.monotonic() - started_s, 3)
            validated = self._validation_loss(validation) if validation else None
            updates, rate = (
                self._config.updates_until(epoch + 1),
                self._config.rate_at(self._config.updates_until(epoch), epoch),
            )
            history.append(EpochRecord(epoch + 1, updates, rate, loss, validated, seconds))
            store.keep(self._network, self._optimizer, history)
        self._network.eval().finish(self._windows)
        store.finish(self._network, history)
        return history

    def _run_epoch(self, epoch: int, progress: Progress) -> float:
        """Make the updates of an epoch (counted from 0) and give their mean loss."""
        first, last = self._config.updates_until(epoch), self._config.updates_until(epoch + 1)
        self._network.train()
        generator = torch.Generator().manual_seed(_epoch_seed(self._seed, epoch))
        drawn = draw_windows(len(self._windows), (last - first) * self._config.batch, generator).to(self._device)
        total = torch.zeros((), device=self._device)
        said_s = time.monotonic()
        for done in range(1, last - first + 1):
            chosen = drawn[(done - 1) * self._config.batch : done * self._config.batch]
            self._set_rate(self._config.rate_at(first + done - 1, epoch))
            batch, translate = self._windows.batch(chosen), self._windows.translate
            total += self._update(augment(batch, self._config.augment, generator, translate=translate))
            # Reading the loss waits for the device, so it is not done after each update.
            if done == last - first or time.monotonic() - said_s > _REPORT_INTERVAL_S:
                loss = total.item() / done
                self._check(loss, epoch)
                message = f"epoch {epoch + 1}/{self._config.epochs} loss {loss:.4f}"
                progress(first + done, self._config.updates_until(self._config.epochs), message)
                said_s = time.monotonic()
        return total.item() / (last - first)

    def _set_rate(self, learning_rate: float) -> None:
        for group in self._optimizer.param_groups:
            group["lr"] = learning_rate

    def _update(self, batch: WindowBatch) -> Tensor:
        loss = self._loss(batch)
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        if self._config.clip_norm is not None:
            torch.nn.utils.clip_grad_norm_(self._network.parameters(), self._config.clip_norm)
        self._optimizer.step()
        return loss.detach()

    def _loss(self, batch: WindowBatch) -> Tensor:
        with autocast(self._device, self._dtype):
            logits = self._network(batch)
        return self._network.loss(logits.float(), batch)

    def _validation_loss(self, windows: WindowSet) -> float:
        self._network.eval()
        total = 0.0
        with torch.inference_mode():
            for batch in windows.batches(self._config.batch):
                total += self._loss(batch).item() * len(batch.target)
        return total / len(windows)

    def _check(self, loss: float, epoch: int) -> None:
        if not math.isfinite(loss):
            raise DivergedError(
                f"training diverged: the loss is not finite in epoch {epoch + 1}; "
                f"try a learning_rate below {self._config.schedule.learning_rate:g} or set clip_norm"
            )


def _epoch_seed(seed: int, epoch: int) -> int:
    digest = hashlib.sha256(f"{seed} {epoch}".encode()).digest()
    return int.from_bytes(digest[:6], "big")
