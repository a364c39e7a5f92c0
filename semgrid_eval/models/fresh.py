"""Fresh errors: who knows the exact world, and of the recording's errors only how such errors are."""

from torch import Tensor

from semgrid_eval.grids.draws import Draws
from semgrid_eval.models.ceiling import DrawSettings
from semgrid_eval.models.model import Given, Model, truth_of
from semgrid_eval.models.votes import likeliest, seen_cells
from semgrid_eval.windows.data import WindowBatch


class FreshErrors(Model):
    """The likeliest class of each cell, over draws of new errors on the exact target: what is measured on average."""

    Settings = DrawSettings
    family = "Truth"
    files = ()

    @classmethod
    def in_words(cls, settings: DrawSettings) -> str:
        """Say what it knows."""
        return f"exact world, {settings.draws} draws of new errors, likeliest class"

    @classmethod
    def asks(cls, settings: DrawSettings, given: Given) -> Draws:
        """Ask for draws."""
        return Draws(settings.draws, continued=False)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the shares of the draws: (B, C, H, W)."""
        seen = seen_cells(batch, translate=self.given.translate) if self.settings.seen_is_known else None
        return likeliest(truth_of(batch), seen)
