"""Baselines without training: repeat the newest grid, overlay sensors, overlay everything seen."""

import torch
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import InputError
from semgrid_eval.models.predictor import one_hot
from semgrid_eval.sequences.dataset import WindowBatch


def overlay(grids: Tensor) -> Tensor:
    """Draw grids over each other, the first on top: (B, K, H, W) class ids -> (B, H, W), unknown cells transparent."""
    result = grids[:, 0]
    for below in grids[:, 1:].unbind(dim=1):
        result = torch.where(result == UNKNOWN, below, result)
    return result


class RepeatNewest:
    """BL-DC where the row translates, BL-NT where it does not: the newest grid of the first sensor, as it is given."""

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Give the newest grid as certain scores: (B, C, H, W)."""
        return one_hot(batch.past[:, 0, -1])


class OverlaySensors:
    """BL-Sp: the newest grids of all sensors, the sensor called `top` drawn over the others (reading 20)."""

    def __init__(self, top: str) -> None:
        self._top = top

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Give the overlay as certain scores: (B, C, H, W).

        Raises:
            InputError: the row has no sensor of that name.
        """
        newest = batch.past[:, _top_first(batch.sensors, self._top), -1]
        return one_hot(overlay(newest))


class FuseAll:
    """BL-Fuse: all inputs of all sensors overlaid, in each cell the newest known class (not in the paper).

    Args:
        top: the sensor that wins among grids of the same time; None takes the row's order.
    """

    def __init__(self, top: str | None = None) -> None:
        self._top = top

    def __call__(self, batch: WindowBatch, /) -> Tensor:
        """Give the overlay as certain scores: (B, C, H, W).

        Raises:
            InputError: the row has no sensor of that name.
        """
        order = _top_first(batch.sensors, self._top or batch.sensors[0])
        newest_first = batch.past[:, order].flip(2).transpose(1, 2)  # (B, T, S, H, W)
        return one_hot(overlay(newest_first.flatten(1, 2)))


def _top_first(sensors: tuple[str, ...], top: str) -> list[int]:
    if top not in sensors:
        raise InputError(f"no sensor {top!r} among {', '.join(sensors)}", field="overlay")
    first = sensors.index(top)
    return [first, *(row for row in range(len(sensors)) if row != first)]
