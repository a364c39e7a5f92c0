"""What most draws of a target say."""

from typing import ClassVar

from pydantic import Field
from torch import Tensor

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.config import Config
from semgrid_eval.grids.draws import MOST_DRAWS, Draws
from semgrid_eval.models.model import Given, Model, truth_of
from semgrid_eval.windows.data import WindowBatch


class DrawSettings(Config):
    """How errors are drawn again, and how draws are answered by."""

    draws: int = Field(15, ge=1, le=MOST_DRAWS)
    # The mask M leaves out what an input saw and the target does not know, so an answer there costs nothing, and
    # networks, whose loss is masked, learn that. With this, too, only known classes are answered where an input saw
    # something; without it, unknown wherever most draws do not know. It is meant for masks that are not `off`.
    seen_is_known: bool = True


class Drawn(Model):
    """Base of models that are told of draws on the exact target and answer by the likeliest class of each cell."""

    Settings = DrawSettings
    family = "Truth"
    files = ()
    continued: ClassVar[bool]  # whether draws go on from the recording's own errors at the newest input

    @classmethod
    def asks(cls, settings: DrawSettings, given: Given) -> Draws:
        """Ask for draws."""
        return Draws(settings.draws, continued=cls.continued)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the shares of the draws: (B, C, H, W)."""
        seen = seen_cells(batch, translate=self.given.translate) if self.settings.seen_is_known else None
        return likeliest(truth_of(batch), seen)


def likeliest(votes: Tensor, seen: Tensor | None = None) -> Tensor:
    """Turn votes of draws into scores, the shares of the draws: (B, C, H, W) uint8 -> (B, C, H, W) float32.

    Where most draws know a cell, so does the answer: unknown has no share there. Likewise where a cell was `seen`
    (B, H, W) and any draw knows it.
    """
    shares = votes.float() / votes.sum(dim=1, keepdim=True)
    unknown = shares[:, UNKNOWN]
    unknown.masked_fill_(unknown < 0.5, 0.0)
    if seen is not None:
        unknown.masked_fill_(seen & (unknown < 1.0), 0.0)
    return shares


def seen_cells(batch: WindowBatch, *, translate: bool) -> Tensor:
    """Tell which cells an input knows, moved into the target's place: (B, H, W) bool."""
    return (batch.aligned(translate=translate) != UNKNOWN).flatten(1, 2).any(dim=1)
