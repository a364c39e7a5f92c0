"""The encoder-decoder (ED) of the paper: grids in, class scores of the target out (readings 4 to 7)."""

import json
from pathlib import Path
from typing import Any, Literal

import torch
from pydantic import Field, field_validator
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn
from torch.nn import functional as F

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.config import Config, parse_config
from semgrid_eval.errors import ConfigError, InputError
from semgrid_eval.files import atomic_file
from semgrid_eval.models.device import seeded
from semgrid_eval.windows.data import WindowBatch

Preset = Literal["keras", "torch"]
Activation = Literal["linear", "relu"]
DROPOUT_RATE = 0.5
_HEADER = "semgrid_eval"


class NetworkConfig(Config):
    """Depth d (encoder blocks) and features f (channels of the first block) of an ED."""

    depth: int = Field(default=3, ge=2, le=6)
    features: int = Field(default=64, ge=2, le=512)
    decoder_activation: Activation = "linear"

    @field_validator("features")
    @classmethod
    def _can_be_halved(cls, features: int) -> int:
        if features % 2:
            raise ValueError("features must be even, because the last block halves them")
        return features


class EncoderDecoder(nn.Module):
    """The ED: d encoder blocks with pooling between them, d - 1 decoder blocks with skip connections.

    Args:
        grids: how many grids a sample has, sensors times inputs.
        preset: whose constants batch normalisation and initial weights follow.
    """

    def __init__(self, config: NetworkConfig, *, grids: int, preset: Preset = "keras") -> None:
        super().__init__()
        widths = [config.features * 2**i for i in range(config.depth)]
        self.config = config
        self.grids = grids
        self.preset: Preset = preset
        self.encoder = nn.ModuleList(
            _Block(inputs, outputs, activation="relu", preset=preset)
            for inputs, outputs in zip([grids * CLASS_COUNT, *widths], widths, strict=False)
        )
        self.dropout = nn.Dropout(DROPOUT_RATE)
        pairs = list(zip(widths[1:], widths[:-1], strict=True))[::-1]
        self.up = nn.ModuleList(_Upsample(inputs, outputs) for inputs, outputs in pairs)
        self.decoder = nn.ModuleList(
            _Block(inputs, outputs, activation=config.decoder_activation, preset=preset) for inputs, outputs in pairs
        )
        self.narrow = nn.Conv2d(config.features, config.features // 2, 3, padding=1)
        self.classify = nn.Conv2d(config.features // 2, CLASS_COUNT, 1)
        if preset == "keras":
            self.apply(_initialise_as_keras)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload] # torch's stubs lack this form

    def forward(self, past: Tensor) -> Tensor:
        """Score the target: (B, S, T, H, W) uint8 class ids -> (B, C, H, W) logits."""
        return self.from_planes(one_hot_planes(past.flatten(1, 2), _working_dtype(self.narrow.weight)))

    def from_planes(self, planes: Tensor) -> Tensor:
        """Score the target from class probabilities: (B, S * T * C, H, W) -> (B, C, H, W) logits."""
        features, skips = planes, list[Tensor]()
        for block in self.encoder:
            features = block(F.max_pool2d(features, 2) if skips else features)
            skips.append(features)
        features = self.dropout(skips.pop())
        for up, block in zip(self.up, self.decoder, strict=True):
            features = block(torch.cat([skips.pop(), up(features)], dim=1))
        return torch.as_tensor(self.classify(self.narrow(features)))

    @property
    def parameter_count(self) -> int:
        """Number of trained values."""
        return sum(parameter.numel() for parameter in self.parameters())


class NetworkPredictor:
    """A trained ED as a predictor: softmax probabilities, computed in the given precision."""

    def __init__(self, network: EncoderDecoder, dtype: torch.dtype = torch.float32) -> None:
        self._network = network.eval()
        self._dtype = dtype

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Return class probabilities: (B, C, H, W) float32."""
        with torch.inference_mode(), autocast(batch.past.device, self._dtype):
            return self._network(batch.past).float().softmax(dim=1)  # type: ignore[no-any-return]


def one_hot_planes(grids: Tensor, dtype: torch.dtype) -> Tensor:
    """Spread class ids over channels: (B, K, H, W) uint8 -> (B, K * C, H, W) in channels-last memory."""
    ids = torch.arange(CLASS_COUNT, dtype=torch.uint8, device=grids.device)
    planes = grids.permute(0, 2, 3, 1).unsqueeze(-1) == ids  # (B, H, W, K, C)
    return planes.flatten(3).to(dtype).permute(0, 3, 1, 2)


def autocast(device: torch.device, dtype: torch.dtype) -> torch.autocast:
    """Compute in `dtype` inside the block; float32 changes nothing."""
    return torch.autocast(device.type, dtype=torch.bfloat16, enabled=dtype == torch.bfloat16)


def seeded_network(config: NetworkConfig, *, grids: int, preset: Preset, seed: int) -> EncoderDecoder:
    """Make an untrained ED on the CPU; the same seed gives the same weights."""
    with seeded(seed, torch.device("cpu")):
        return EncoderDecoder(config, grids=grids, preset=preset)


def check_grid_size(config: NetworkConfig, rows: int, columns: int) -> None:
    """Check that the grid can be halved d - 1 times.

    Raises:
        ConfigError: it cannot.
    """
    factor = 2 ** (config.depth - 1)
    if rows % factor or columns % factor:
        raise ConfigError(f"depth {config.depth} needs grids of a multiple of {factor} cells, not {rows} x {columns}")


def save_network(network: EncoderDecoder, path: Path, **notes: str) -> None:
    """Write weights as safetensors; the header has all that `load_network` needs, and `notes`."""
    header = {"config": network.config.model_dump(), "grids": network.grids, "preset": network.preset, **notes}
    tensors = {name: value.detach().cpu().contiguous() for name, value in network.state_dict().items()}
    # One entry, because safetensors writes several in an order that changes from time to time.
    content = save(tensors, metadata={_HEADER: json.dumps(header, sort_keys=True)})
    with atomic_file(path) as stream:
        stream.write(content)


def load_network(path: Path, device: torch.device | None = None) -> EncoderDecoder:
    """Read a network that `save_network` wrote.

    Raises:
        InputError: the file is missing, damaged or not of this kind.
    """
    header = read_header(path)
    try:
        config = parse_config(NetworkConfig, header["config"], path=path)
        network = EncoderDecoder(config, grids=header["grids"], preset=header["preset"])
        with safe_open(path, framework="pt") as archive:
            network.load_state_dict({name: archive.get_tensor(name) for name in archive.keys()})  # noqa: SIM118
    except (KeyError, TypeError, RuntimeError) as error:
        raise InputError(f"holds no network of this version: {error}", path=path) from error
    return network.to(device or torch.device("cpu")).eval()


def read_header(path: Path) -> dict[str, Any]:
    """Read what `save_network` wrote beside the weights.

    Raises:
        InputError: the file is missing, damaged or not of this kind.
    """
    try:
        with safe_open(path, framework="pt") as archive:
            return dict(json.loads((archive.metadata() or {})[_HEADER]))
    except (OSError, SafetensorError) as error:
        raise InputError(f"cannot be read: {error}", path=path) from error
    except (KeyError, TypeError, ValueError):
        raise InputError("holds no network of this version", path=path) from None


class _Block(nn.Sequential):
    """Twice: 3 x 3 convolution, batch normalisation, activation."""

    def __init__(self, inputs: int, outputs: int, *, activation: Activation, preset: Preset) -> None:
        layers: list[nn.Module] = []
        for width in (inputs, outputs):
            # A bias would be removed by the normalisation that follows.
            layers += [nn.Conv2d(width, outputs, 3, padding=1, bias=False), _normalisation(outputs, preset)]
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


def _normalisation(channels: int, preset: Preset) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, eps=1e-3, momentum=0.01) if preset == "keras" else nn.BatchNorm2d(channels)


def _initialise_as_keras(module: nn.Module) -> None:
    if isinstance(module, nn.Conv2d):
        nn.init.xavier_uniform_(module.weight)
        if module.bias is not None:
            nn.init.zeros_(module.bias)


def _working_dtype(weight: Tensor) -> torch.dtype:
    """Type that a convolution with this weight will compute in."""
    device = weight.device.type
    return torch.get_autocast_dtype(device) if torch.is_autocast_enabled(device) else weight.dtype
