"""BL-DC and BL-NT: the newest input repeated."""

from torch import Tensor

from semgrid_eval.models.model import Baseline, one_hot
from semgrid_eval.windows.data import WindowBatch


class RepeatNewest(Baseline):
    """BL-DC where the row translates, BL-NT where it does not: the newest grid of the first sensor, as it is given."""

    words = "newest input"
    bound = "lower"

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the newest grid as certain scores: (B, C, H, W)."""
        return one_hot(batch.past[:, 0, -1], self.given.classes.count)
