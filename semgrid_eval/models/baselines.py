"""Baselines without training: repeat the newest grid, overlay sensors, overlay everything seen."""

import torch
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import InputError
from semgrid_eval.models.predictor import one_hot
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


class RepeatNewest:
    """BL-DC where the row translates, BL-NT where it does not: the newest grid of the first sensor, as it is given."""

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Return the newest grid as certain scores: (B, C, H, W)."""
        return one_hot(batch.past[:, 0, -1])


class OverlaySensors:
    """BL-Sp: the newest grids of all sensors, the sensor called `top` drawn over the others (reading 20)."""

    def __init__(self, top: str) -> None:
        self._top = top

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Return the overlay as certain scores: (B, C, H, W).

        Raises:
            InputError: the row has no sensor of that name.
        """
        if self._top not in batch.sensors:
            raise InputError(f"no sensor {self._top!r} among {', '.join(batch.sensors)}", field="overlay")
        top = batch.sensors.index(self._top)
        order = [top, *(row for row in range(len(batch.sensors)) if row != top)]
        return one_hot(overlay(batch.past[:, order, -1]))


class FuseAll:
    """BL-Fuse: all inputs of all sensors overlaid, in each cell the newest known class (not in the paper).

    Of grids of the same time the row's first sensor wins.
    """

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Return the overlay as certain scores: (B, C, H, W)."""
        return one_hot(overlay(newest_first(batch)))
