"""The encoder-decoder (ED) of the paper: grids in, class scores of the target out (readings 4 to 7)."""

from typing import Literal

import torch
from pydantic import Field, field_validator
from torch import Tensor, nn
from torch.nn import functional as F

from semgrid_eval.errors import ConfigError
from semgrid_eval.models.model import Given
from semgrid_eval.models.network import Constants, Network, NetworkSettings, input_planes
from semgrid_eval.models.prior import CellPrior
from semgrid_eval.windows.data import WindowBatch, WindowSet
from semgrid_eval.words import plural

Activation = Literal["linear", "relu"]
DROPOUT_RATE = 0.5


class EncoderDecoderSettings(NetworkSettings):
    """Settings of an ED."""

    depth: int = Field(default=3, ge=2, le=6)  # encoder blocks, d
    features: int = Field(default=64, ge=2, le=512)  # channels of the first block, f
    decoder_activation: Activation = "linear"  # of the decoder's convolutions (reading 5)
    constants: Constants = "keras"  # whose constants batch normalisation and initial weights follow (reading 7)
    prior: bool = False  # whether it adds to the table of `models.prior`, as the paper's does not

    @field_validator("features")
    @classmethod
    def _can_be_halved(cls, features: int) -> int:
        if features % 2:
            raise ValueError(f"{features} is odd, and the last block halves it")
        return features


class EncoderDecoder(Network):
    """The ED: d encoder blocks with pooling between them, d - 1 decoder blocks with skip connections."""

    Settings = EncoderDecoderSettings
    family = "ED"

    def __init__(self, settings: EncoderDecoderSettings, given: Given) -> None:
        super().__init__(settings, given)
        widths = [settings.features * 2**i for i in range(settings.depth)]
        constants = settings.constants
        self.encoder = nn.ModuleList(
            _Block(inputs, outputs, activation="relu", constants=constants)
            for inputs, outputs in zip([given.planes, *widths], widths, strict=False)
        )
        self.dropout = nn.Dropout(DROPOUT_RATE)
        pairs = list(zip(widths[1:], widths[:-1], strict=True))[::-1]
        self.up = nn.ModuleList(_Upsample(inputs, outputs) for inputs, outputs in pairs)
        self.decoder = nn.ModuleList(
            _Block(inputs, outputs, activation=settings.decoder_activation, constants=constants)
            for inputs, outputs in pairs
        )
        self.narrow = nn.Conv2d(settings.features, settings.features // 2, 3, padding=1)
        self.classify = nn.Conv2d(settings.features // 2, given.classes.count, 1)
        if constants == "keras":
            self.apply(_initialise_as_keras)
        self.prior = CellPrior(given) if settings.prior else None
        if settings.prior:
            nn.init.zeros_(self.classify.weight)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload] # torch's stubs lack this form

    @classmethod
    def in_words(cls, settings: EncoderDecoderSettings) -> str:
        """Say what the model does."""
        size = f"depth {settings.depth}, {plural(settings.features, 'feature')}"
        return f"encoder-decoder of {size}" + ", over a table" * settings.prior

    @classmethod
    def check(cls, settings: EncoderDecoderSettings, given: Given) -> None:
        """Refuse grids that cannot be halved d - 1 times."""
        factor = 2 ** (settings.depth - 1)
        if given.rows % factor or given.columns % factor:
            size = f"{given.rows} x {given.columns}"
            raise ConfigError(
                f"depth {settings.depth} needs grids of a multiple of {factor} cells, not {size}", field="settings"
            )

    def prepare(self, windows: WindowSet) -> None:
        """Count the table, where there is one."""
        if self.prior is not None:
            self.prior.count(windows)

    def forward(self, batch: WindowBatch) -> Tensor:
        """Score the target: (B, C, H, W) logits."""
        logits = self.from_planes(input_planes(batch.past, self.given.classes.count))
        return logits.float() + self.prior(batch) if self.prior is not None else logits

    def from_planes(self, planes: Tensor) -> Tensor:
        """Score the target from class probabilities: (B, S * T * C, H, W) -> (B, C, H, W) logits."""
        features = planes
        skips: list[Tensor] = []  # `list[Tensor]()` stops torch.compile
        for block in self.encoder:
            features = block(F.max_pool2d(features, 2) if skips else features)
            skips.append(features)
        features = self.dropout(skips.pop())
        for up, block in zip(self.up, self.decoder, strict=True):
            features = block(torch.cat([skips.pop(), up(features)], dim=1))
        return torch.as_tensor(self.classify(self.narrow(features)))


class _Block(nn.Sequential):
    """Twice: 3 x 3 convolution, batch normalisation, activation."""

    def __init__(self, inputs: int, outputs: int, *, activation: Activation, constants: Constants) -> None:
        layers: list[nn.Module] = []
        eps, momentum = (1e-3, 0.01) if constants == "keras" else (1e-5, 0.1)
        for width in (inputs, outputs):
            # A bias would be removed by the normalisation that follows.
            layers += [nn.Conv2d(width, outputs, 3, padding=1, bias=False), nn.BatchNorm2d(outputs, eps, momentum)]
            layers += [nn.ReLU(inplace=True)] if activation == "relu" else []
        super().__init__(*layers)


class _Upsample(nn.Module):
    """Nearest neighbour times two, then a 2 x 2 convolution padded as Keras does: below and to the right."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(inputs, outputs, 2)

    def forward(self, features: Tensor) -> Tensor:
        larger = F.interpolate(features, scale_factor=2, mode="nearest")
        return torch.as_tensor(self.convolution(F.pad(larger, (0, 1, 0, 1))))


def _initialise_as_keras(module: nn.Module) -> None:
    if isinstance(module, nn.Conv2d):
        nn.init.xavier_uniform_(module.weight)
        if module.bias is not None:
            nn.init.zeros_(module.bias)
