"""What gradients train: a torch module with its loss, optimiser and schedule, and grids as planes for its layers."""

import math
from collections.abc import Iterator
from typing import Any, Literal, Self, TypeVar

import torch
from pydantic import Field, field_validator, model_validator
from torch import Tensor
from torch.nn import functional as F

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import Config, merged, strictly
from semgrid_eval.models.augment import AugmentConfig
from semgrid_eval.models.certainty import Certainty
from semgrid_eval.models.device import Precision, choose_precision, seeded
from semgrid_eval.models.model import Given, Model, one_hot
from semgrid_eval.windows.data import WindowBatch, WindowSet
from semgrid_eval.words import plural

Constants = Literal["keras", "torch"]
_IGNORED = -100
_OPTIMIZERS: dict[tuple[str, str], tuple[type[torch.optim.Optimizer], dict[str, Any]]] = {
    ("rmsprop", "keras"): (torch.optim.RMSprop, {"alpha": 0.9, "eps": 1e-7}),
    ("rmsprop", "torch"): (torch.optim.RMSprop, {"alpha": 0.99, "eps": 1e-8}),
    ("adam", "keras"): (torch.optim.Adam, {"eps": 1e-7}),
    ("adam", "torch"): (torch.optim.Adam, {"eps": 1e-8}),
}


class OptimizerConfig(Config):
    """What makes the updates; `constants` says whose defaults it has (reading 7)."""

    kind: Literal["rmsprop", "adam"] = "rmsprop"
    constants: Constants = "keras"

    def make(self, parameters: Iterator[torch.nn.Parameter], learning_rate: float) -> torch.optim.Optimizer:
        """Make the optimiser of these parameters."""
        kind, constants = _OPTIMIZERS[self.kind, self.constants]
        return kind(parameters, lr=learning_rate, **constants)  # type: ignore[call-arg]


class ScheduleConfig(Config):
    """The learning rate over a training; the defaults are the paper's."""

    learning_rate: float = Field(default=1e-3, gt=0)
    shape: Literal["drop", "cosine"] = "drop"  # `cosine` warms up, then falls to nothing as half a wave does
    # Of `drop`: epochs after it use `rate_after_drop`; None keeps `learning_rate`.
    drop_epoch: int | None = Field(default=35, ge=0)
    rate_after_drop: float = Field(default=1e-4, gt=0)
    warm_up: float = Field(default=0.05, ge=0, lt=1)  # of `cosine`: share of the updates in which the rate rises


class LossConfig(Config):
    """What a training makes small: the paper's cross entropy, and more on request."""

    jaccard: float = Field(default=0.0, ge=0)  # weight of the soft Jaccard loss beside the cross entropy


class TrainingConfig(Config):
    """How a network is trained; the defaults are the paper's (readings 1 and 7)."""

    epochs: int = Field(default=40, ge=1)
    updates_per_epoch: int = Field(default=185, ge=1)  # batches, or windows with `epoch_unit: windows`
    epoch_unit: Literal["batches", "windows"] = "batches"
    batch: int = Field(default=32, ge=1, le=1 << 16)
    precision: Precision = "auto"  # `auto` takes bfloat16 where the device multiplies in it natively
    clip_norm: float | None = Field(default=None, gt=0)  # limit of the gradient's norm; the paper has none
    optimizer: OptimizerConfig = OptimizerConfig()
    schedule: ScheduleConfig = ScheduleConfig()
    loss: LossConfig = LossConfig()
    augment: AugmentConfig = AugmentConfig()  # of each batch, from the epoch's seed
    calibrate: bool = False  # whether `models.certainty` follows, which changes no predicted class

    @model_validator(mode="after")
    def _epoch_holds_a_batch(self) -> Self:
        if self.updates_until(1) < 1:
            raise ValueError(
                f"an epoch of {plural(self.updates_per_epoch, 'window')} does not fill a batch of {self.batch}"
            )
        return self

    def updates_until(self, epoch: int) -> int:
        """Updates made when `epoch` epochs are over; a batch that two epochs share counts for the second."""
        per_update = self.batch if self.epoch_unit == "windows" else 1
        return epoch * self.updates_per_epoch // per_update

    def rate_at(self, update: int, epoch: int) -> float:
        """Learning rate of an update in its epoch, both counted from 0."""
        schedule = self.schedule
        if schedule.shape == "drop":
            late = schedule.drop_epoch is not None and epoch >= schedule.drop_epoch
            return schedule.rate_after_drop if late else schedule.learning_rate
        total = self.updates_until(self.epochs)
        rising = max(1, round(schedule.warm_up * total))
        if update < rising:
            return schedule.learning_rate * (update + 1) / rising
        return schedule.learning_rate * 0.5 * (1 + math.cos(math.pi * (update - rising) / max(1, total - rising)))


class NetworkSettings(Config):
    """Settings of any network; its own class adds what its layers need."""

    training: TrainingConfig = TrainingConfig()

    @field_validator("training", mode="before")
    @classmethod
    def _over_its_own(cls, values: object) -> object:
        """Put what is set of the training over the default of this network, not over the paper's."""
        own = cls.model_fields["training"].get_default(call_default_factory=True)
        return strictly(type(own), merged(own.model_dump(), values)) if isinstance(values, dict) else values


class Network(Model, torch.nn.Module):
    """Base of all that gradients train: subclass it, make layers in `__init__` and logits in `forward`.

    `semgrid_eval.models.training` does the rest. Weights come from the training, so that no file is read unless
    `files` says so.
    """

    Settings = NetworkSettings
    random = True
    files = ()

    def __init__(self, settings: Any, given: Given) -> None:  # noqa: ANN401 - of the class `Settings`
        super().__init__(settings, given)
        self.certainty = Certainty(given.classes.count) if self.training_config.calibrate else None

    def prepare(self, windows: WindowSet) -> None:
        """Set what a training starts from by its windows, before the first update; most networks need nothing."""

    def forward(self, batch: WindowBatch) -> Tensor:
        """Score the target from a batch's past and motion: (B, C, H, W) logits."""
        raise NotImplementedError(f"{type(self).__name__} has no `forward`")

    def loss(self, logits: Tensor, batch: WindowBatch) -> Tensor:
        """Return what the training makes small: float32 logits (B, C, H, W) -> scalar, a mean over the windows."""
        loss, weight = masked_loss(logits, batch.target, batch.mask), self.training_config.loss.jaccard
        return loss + weight * jaccard_loss(logits, batch.target, batch.mask) if weight else loss

    def optimizer(self) -> torch.optim.Optimizer:
        """Make the optimiser that the settings ask for."""
        training = self.training_config
        return training.optimizer.make(self.parameters(), training.schedule.learning_rate)

    def finish(self, windows: WindowSet) -> None:
        """Set what the training's end is needed for, by the training windows: how sure it is, where that is asked."""
        if self.certainty is not None:
            self.certainty.fit(self.probabilities, windows)

    def probabilities(self, batch: WindowBatch) -> Tensor:
        """Return the softmax of its logits: (B, C, H, W) float32, computed in the precision of the training."""
        dtype = self.dtype_on(batch.past.device)
        with torch.inference_mode(), autocast(batch.past.device, dtype):
            return torch.as_tensor(self(batch)).float().softmax(dim=1)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return class probabilities (B, C, H, W) float32; with `calibrate`, scaled to the certainty of each cell."""
        probabilities = self.probabilities(batch)
        return probabilities if self.certainty is None else self.certainty(probabilities)

    @property
    def training_config(self) -> TrainingConfig:
        """How it is trained."""
        return self.settings.training  # type: ignore[no-any-return]

    def dtype_on(self, device: torch.device) -> torch.dtype:
        """Return what it computes in on a device."""
        return choose_precision(self.training_config.precision, device)

    @classmethod
    def learns(cls) -> bool:
        """Whether it is fitted to training windows: always."""
        return True


N = TypeVar("N", bound=Network)


def seeded_network(network: type[N], settings: Config, given: Given, seed: int) -> N:
    """Make an untrained network on the CPU; the same seed gives the same weights."""
    with seeded(seed, torch.device("cpu")):
        return network(settings, given)


def masked_loss(logits: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Cross entropy without loss inside M, the mean over all cells (reading 10).

    Logits (B, C, H, W), target (B, H, W) uint8, mask M (B, H, W) bool -> scalar. Taking the target for the prediction
    inside M, as the paper's equation does, makes the loss there zero.
    """
    counted = target.long().masked_fill(mask, _IGNORED)
    # A sum inside CUDA's cross entropy comes in an order that changes from time to time; one after it does not.
    reduction = "none" if logits.is_cuda else "sum"
    losses = F.cross_entropy(logits.float(), counted, ignore_index=_IGNORED, reduction=reduction)
    return losses.sum() / target.numel()


def jaccard_loss(logits: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """One minus the IoU of probabilities, the mean over the classes that targets show, outside M.

    Logits (B, C, H, W), target (B, H, W) uint8, mask M (B, H, W) bool -> scalar. Intersections and unions are summed
    over the batch, and one cell is added to both (Rahman and Wang 2016).
    """
    counted = ~mask[:, None]
    probability = logits.float().softmax(dim=1) * counted
    truth = one_hot(target, logits.shape[1]) * counted
    both, seen = (probability * truth).sum(dim=(0, 2, 3)), truth.sum(dim=(0, 2, 3))
    union = probability.sum(dim=(0, 2, 3)) + seen - both
    present = seen > 0
    return (present * (1 - (both + 1) / (union + 1))).sum() / present.sum().clamp(min=1)


def input_planes(past: Tensor, classes: int = CLASS_COUNT) -> Tensor:
    """Spread all inputs over channels: (B, S, T, H, W) uint8 -> (B, S * T * C, H, W) in channels-last memory.

    The planes have the type that layers compute in; there are as many of each grid as `classes`, by default those of
    the default set.
    """
    device = past.device.type
    lower = device != "meta" and torch.is_autocast_enabled(device)  # meta: only shapes are asked for
    dtype = torch.get_autocast_dtype(device) if lower else torch.float32
    ids = torch.arange(classes, dtype=torch.uint8, device=past.device)
    planes = past.flatten(1, 2).permute(0, 2, 3, 1).unsqueeze(-1) == ids  # (B, H, W, S * T, C)
    return planes.flatten(3).to(dtype).permute(0, 3, 1, 2)


def autocast(device: torch.device, dtype: torch.dtype) -> torch.autocast:
    """Compute in `dtype` inside the block; float32 changes nothing."""
    return torch.autocast(device.type, dtype=torch.bfloat16, enabled=dtype == torch.bfloat16)
