"""RN: a residual network that corrects, cell by cell, what a table says of the overlaid inputs (not in the paper)."""

from itertools import pairwise
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor, nn
from torch.nn import functional as F

from semgrid_eval.classes import ClassSet
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.augment import AugmentConfig
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import (
    LossConfig,
    Network,
    NetworkSettings,
    OptimizerConfig,
    ScheduleConfig,
    TrainingConfig,
    input_planes,
)
from semgrid_eval.models.prior import CellPrior
from semgrid_eval.windows.data import WindowBatch, WindowSet

Width = Annotated[int, Field(ge=1, le=1024)]
FOLD = 2  # cells along each axis that become channels of one place of the trunk
LEAD_BINS = 12  # of the table, where the network is to answer any lead: .1 s each
_STAY = 5.0  # what the shift mixture starts with for no displacement, beside 0 for all others
_SHUT = -2.0  # what its gate starts with, before the sigmoid


class ResidualSettings(NetworkSettings):
    """Settings of an RN; each part can be left out, to see what it is worth."""

    training: TrainingConfig = TrainingConfig(
        epochs=10,
        updates_per_epoch=140,
        batch=8,
        optimizer=OptimizerConfig(kind="adam"),
        schedule=ScheduleConfig(learning_rate=2e-3, shape="cosine"),
        loss=LossConfig(jaccard=1.0),
        augment=AugmentConfig(flip=0.5),
        calibrate=True,
    )
    widths: tuple[Width, ...] = Field((32, 64, 96, 128), min_length=1, max_length=6)  # channels, each at half the size
    fine: int = Field(24, ge=0, le=256)  # channels at full resolution; 0 leaves that branch out
    prior: bool = True  # whether it adds to the table of `models.prior`
    shift: int = Field(0, ge=0, le=8)  # reach of the shift mixture, in places of the trunk; 0 leaves it out
    lead_input: bool = False  # whether it is told the times of its inputs, to answer any lead


class Residual(Network):
    """A U-Net on folded one-hot planes whose answer is added to a counted table, from nothing at first."""

    Settings = ResidualSettings
    family = "RN"

    def __init__(self, settings: ResidualSettings, given: Given) -> None:
        super().__init__(settings, given)
        widths = settings.widths
        lead_bins = LEAD_BINS if settings.lead_input else 1
        self.prior = CellPrior(given, lead_bins=lead_bins) if settings.prior else None
        self.stem = _Convolution(given.planes * FOLD**2, widths[0])
        self.told = nn.Linear(given.inputs, widths[0]) if settings.lead_input else None
        self.down = nn.ModuleList(_Pair(width) for width in widths)
        self.narrow = nn.ModuleList(_Convolution(before, after, stride=2) for before, after in pairwise(widths))
        self.widen = nn.ModuleList(nn.Conv2d(after, before, 1) for before, after in pairwise(widths))
        self.up = nn.ModuleList(_Pair(width) for width in widths[:-1])
        fine = settings.fine or given.classes.count
        self.unfold = nn.Conv2d(widths[0], fine * FOLD**2, 1)
        self.fine = _Fine(given.planes, fine) if settings.fine else None
        self.classify = nn.Conv2d(fine, given.classes.count, 1)
        self.shift = _ShiftMixture(widths[0], settings.shift, given.classes) if settings.shift else None
        if settings.prior:
            nn.init.zeros_(self.classify.weight)
            nn.init.zeros_(torch.as_tensor(self.classify.bias))
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload] # torch's stubs lack this form

    @classmethod
    def in_words(cls, settings: ResidualSettings) -> str:
        """Say what the model does."""
        told = ", told the lead" * settings.lead_input
        return f"residual network of {' / '.join(map(str, settings.widths))} channels" + told

    @classmethod
    def check(cls, settings: ResidualSettings, given: Given) -> None:
        """Refuse to move what does not."""
        if settings.shift:
            require_what_moves(given.classes, "settings.shift")

    def prepare(self, windows: WindowSet) -> None:
        """Count the table."""
        if self.prior is not None:
            self.prior.count(windows, self.shown)

    def shown(self, batch: WindowBatch) -> WindowBatch:
        """Return a batch as the layers and the table see it."""
        return batch

    def forward(self, batch: WindowBatch) -> Tensor:
        """Score the target: (B, C, H, W) logits."""
        batch = self.shown(batch)
        planes = input_planes(batch.past, self.given.classes.count)
        rows, columns = planes.shape[-2:]
        multiple = FOLD * 2 ** len(self.narrow)
        planes = F.pad(planes, (0, -columns % multiple, 0, -rows % multiple))
        features = self._trunk(F.pixel_unshuffle(planes, FOLD), batch.lead_s)
        fine = F.pixel_shuffle(self.unfold(features), FOLD)
        logits = self.classify(self.fine(fine, planes) if self.fine is not None else fine)
        if self.shift is not None:
            logits = logits + self.shift(features, planes, batch.past.shape[1])
        logits = torch.as_tensor(logits)[..., :rows, :columns]
        return logits.float() + self.prior(batch) if self.prior is not None else logits

    def _trunk(self, folded: Tensor, lead_s: Tensor) -> Tensor:
        features, skips = self.stem(folded), list[Tensor]()
        if self.told is not None:
            features = features + self.told(lead_s)[:, :, None, None]
        for level, pair in enumerate(self.down):
            features = pair(self.narrow[level - 1](features) if level else features)
            skips.append(features)
        skips.pop()
        for level in reversed(range(len(self.up))):
            larger = F.interpolate(self.widen[level](features), scale_factor=2, mode="nearest")
            features = self.up[level](larger + skips.pop())
        return torch.as_tensor(features)


def require_what_moves(classes: ClassSet, field: str) -> None:
    """Refuse what is there for motion where no class moves; `field` of the row asks for it.

    Raises:
        ConfigError: none does.
    """
    if not classes.movable:
        raise ConfigError("no class of grid.classes moves, and that is what it is for", field=field)


class _Convolution(nn.Sequential):
    """3 x 3 convolution, batch normalisation, ReLU."""

    def __init__(self, inputs: int, outputs: int, *, stride: int = 1) -> None:
        convolution = nn.Conv2d(inputs, outputs, 3, stride, padding=1, bias=False)
        super().__init__(convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class _Pair(nn.Module):
    """Two convolutions whose answer is added to their input."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = _Convolution(width, width)
        self.second = nn.Sequential(nn.Conv2d(width, width, 3, padding=1, bias=False), nn.BatchNorm2d(width))

    def forward(self, features: Tensor) -> Tensor:
        return F.relu(features + self.second(self.first(features)), inplace=True)


class _Fine(nn.Module):
    """The trunk's answer at full resolution, with the planes themselves, through one residual convolution."""

    def __init__(self, planes: int, width: int) -> None:
        super().__init__()
        self.see = nn.Conv2d(planes, width, 3, padding=1, bias=False)
        self.normalise = nn.BatchNorm2d(width)
        self.mix = _Convolution(width, width)

    def forward(self, coarse: Tensor, planes: Tensor) -> Tensor:
        features = F.relu(self.normalise(coarse + self.see(planes)))
        return torch.as_tensor(features + self.mix(features))


class _ShiftMixture(nn.Module):
    """Moves the cells of what can move by a mixture of displacements that each place of the trunk chooses."""

    movable: Tensor  # (M,) ids of their classes

    def __init__(self, width: int, reach: int, classes: ClassSet) -> None:
        super().__init__()
        self._reach, side = reach, 2 * reach + 1
        self._classes, movable = classes.count, classes.movable
        self.choose = nn.Conv2d(width, side * side, 1)
        self.gate = nn.Conv2d(width, len(movable), 1)
        self.gain = nn.Parameter(torch.full((len(movable), 1, 1), 3.0))
        nn.init.zeros_(self.choose.weight)
        stay = torch.zeros(side * side)
        stay[side * side // 2] = _STAY
        self.choose.bias = nn.Parameter(stay)
        nn.init.constant_(torch.as_tensor(self.gate.bias), _SHUT)
        self.register_buffer("movable", torch.tensor(movable, dtype=torch.int64), persistent=False)

    def forward(self, features: Tensor, planes: Tensor, sensors: int) -> Tensor:
        """Return what is added to the logits: (B, C, H, W).

        Args:
            features: (B, D, H / 2, W / 2) of the trunk.
            planes: (B, S * T * C, H, W) of all inputs.
            sensors: S.
        """
        batch, _, rows, columns = planes.shape
        newest = planes.view(batch, sensors, -1, self._classes, rows, columns)[:, :, -1].amax(dim=1)
        newest = newest.index_select(1, self.movable)
        folded = F.pixel_unshuffle(newest, FOLD)  # (B, 4 M, H / 2, W / 2), M classes that move
        seen = F.unfold(folded, 2 * self._reach + 1, padding=self._reach)
        seen = seen.view(batch, folded.shape[1], -1, *folded.shape[-2:])  # (B, 4 M, displacements, H / 2, W / 2)
        weights = self.choose(features).softmax(dim=1)
        moved = F.pixel_shuffle((seen * weights[:, None]).sum(dim=2), FOLD)
        gate = F.interpolate(self.gate(features).sigmoid(), scale_factor=FOLD, mode="nearest")
        change = gate * self.gain * (moved - newest)
        added = change.new_zeros(batch, self._classes, rows, columns)
        return added.index_copy(1, self.movable, change)
