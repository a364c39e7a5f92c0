"""The ceiling: who knows the exact world, and how the recording's errors stand at the newest input."""

from pydantic import Field
from torch import Tensor

from semgrid_eval.config import Config
from semgrid_eval.grids.draws import MOST_DRAWS, Draws
from semgrid_eval.models.model import Given, Model, truth_of
from semgrid_eval.models.votes import likeliest, seen_cells
from semgrid_eval.windows.data import WindowBatch


class DrawSettings(Config):
    """How errors are drawn again, and how draws are answered by."""

    draws: int = Field(15, ge=1, le=MOST_DRAWS)
    # The mask M leaves out what an input saw and the target does not know, so an answer there costs nothing, and
    # networks, whose loss is masked, learn that. With this, too, only known classes are answered where an input saw
    # something; without it, unknown wherever most draws do not know. It is meant for masks that are not `off`.
    seen_is_known: bool = True


class Ceiling(Model):
    """The likeliest class of each cell, over draws that continue the recording's errors on the exact target.

    What is measured at the target's time depends on the world there, which is known, and on errors, of which no more
    is known than the inputs could tell. So no model has more cells right on average, but for the chance in a finite
    number of draws; IoU follows closely, though not to the letter.
    """

    Settings = DrawSettings
    family = "Truth"
    bound = "upper"
    files = ()

    @classmethod
    def in_words(cls, settings: DrawSettings) -> str:
        """Say what it knows."""
        return f"exact world, this recording's errors continued in {settings.draws} draws, likeliest class"

    @classmethod
    def asks(cls, settings: DrawSettings, given: Given) -> Draws:
        """Ask for draws."""
        return Draws(settings.draws, continued=True)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the shares of the draws: (B, C, H, W)."""
        seen = seen_cells(batch, translate=self.given.translate) if self.settings.seen_is_known else None
        return likeliest(truth_of(batch), seen)
