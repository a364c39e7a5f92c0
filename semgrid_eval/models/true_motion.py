"""BL-Fuse with true motion: what motion alone is worth, without knowing what no input shows."""

from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import ConfigError
from semgrid_eval.grids.moved_actors import MovedActors
from semgrid_eval.models.model import Given, Model, one_hot, truth_of
from semgrid_eval.models.overlay import newest_first, overlay
from semgrid_eval.windows.data import WindowBatch
from semgrid_eval.windows.grids import shift_grids


class FuseTrueMotion(Model):
    """All inputs overlaid as BL-Fuse does, after the actors that they show are moved by their true motion.

    What an actor leaves behind is unknown, unless another input shows it.
    """

    words = "all inputs overlaid, each actor that they show moved by its true motion"
    family = "Truth"
    files = ()

    @classmethod
    def check(cls, settings: Any, given: Given) -> None:  # noqa: ANN401 - none
        """Refuse inputs that stay where they are."""
        if not given.translate:
            raise ConfigError("is false, and true motion is motion to the target's place", field="translate")

    @classmethod
    def asks(cls, settings: Any, given: Given) -> MovedActors:  # noqa: ANN401 - none
        """Ask for the moving actors of its inputs."""
        return MovedActors(given.sensors)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the overlay as certain scores: (B, C, H, W)."""
        left, arrived = truth_of(batch).unbind(dim=3)
        stays = shift_grids(left, batch.shift_cells[:, None]) == 0
        bare = torch.where(stays, batch.past, UNKNOWN)
        moved = torch.where(arrived == UNKNOWN, bare, arrived)
        return one_hot(overlay(newest_first(replace(batch, past=moved))), self.given.classes.count)
