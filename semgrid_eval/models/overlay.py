"""BL-Sp and BL-Fuse: sensors, or everything seen, drawn over each other."""

import torch
from pydantic import Field
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.config import Config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.model import Baseline, Given, one_hot
from semgrid_eval.windows.data import WindowBatch


def overlay(grids: Tensor) -> Tensor:
    """Draw grids over each other, the first on top: (B, K, H, W) class ids -> (B, H, W), unknown cells transparent."""
    result = grids[:, 0]
    for below in grids[:, 1:].unbind(dim=1):
        result = torch.where(result == UNKNOWN, below, result)
    return result


def newest_first(batch: WindowBatch) -> Tensor:
    """Put the grids of the past in one row, newest first and sensors in order: (B, T * S, H, W)."""
    return batch.past.flip(2).transpose(1, 2).flatten(1, 2)


class OverlaySettings(Config):
    """Settings of BL-Sp."""

    top: str = Field("upper", min_length=1)  # part of the name of the sensor that is drawn over the others (reading 20)


class OverlaySensors(Baseline):
    """BL-Sp: the newest grids of all sensors, one of them drawn over the others (reading 20)."""

    Settings = OverlaySettings
    words = "newest input of one sensor drawn over the other's"

    @classmethod
    def check(cls, settings: OverlaySettings, given: Given) -> None:
        """Refuse sensors of which not exactly one is to be on top."""
        if sum(settings.top in name for name in given.sensors) != 1:
            raise ConfigError(
                f"{settings.top!r} must be part of the name of one sensor alone, of {', '.join(given.sensors)}",
                field="settings.top",
            )

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the overlay as certain scores: (B, C, H, W)."""
        order = sorted(range(len(batch.sensors)), key=lambda row: self.settings.top not in batch.sensors[row])
        return one_hot(overlay(batch.past[:, order, -1]), self.given.classes.count)


class FuseAll(Baseline):
    """BL-Fuse: all inputs of all sensors overlaid, in each cell the newest known class (not in the paper).

    Of grids of the same time the row's first sensor wins.
    """

    words = "all inputs overlaid, newest known cell wins"

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the overlay as certain scores: (B, C, H, W)."""
        return one_hot(overlay(newest_first(batch)), self.given.classes.count)
