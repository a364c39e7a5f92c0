"""A table that a network starts from: the target's class given what the inputs last showed in the cell."""

from collections.abc import Callable

import torch
from torch import Tensor, nn

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.models.model import Given
from semgrid_eval.models.overlay import newest_first
from semgrid_eval.windows.data import WindowBatch, WindowSet

COUNTED_WINDOWS = 1500  # at most, spread evenly over the training windows
SMOOTHING_CELLS = 0.3  # added to each count, so that nothing is impossible
FLOOR = -9.0  # of a log-probability, beside the likeliest class
_BATCH = 50  # windows that are counted at once
Shown = Callable[[WindowBatch], WindowBatch]


class CellPrior(nn.Module):
    """Log-probabilities of a cell's class, given the newest known class, its age and the class known before it.

    It is counted on training windows and then trained with the network that adds to it, which so begins as a table over
    BL-Fuse's overlay. With several `lead_bins` there is a table for each part of `lead_span_s`.
    """

    def __init__(self, given: Given, *, lead_bins: int = 1, lead_span_s: float = 1.2) -> None:
        super().__init__()
        self._lead_bins, self._lead_span_s, self._classes = lead_bins, lead_span_s, given.classes.count
        self.table = nn.Parameter(torch.zeros(lead_bins * given.grids * self._classes**2, self._classes))

    def count(self, windows: WindowSet, shown: Shown = lambda batch: batch) -> None:
        """Set the table to what training windows, as they are `shown` to the network, show outside M."""
        counts = torch.full(self.table.shape, SMOOTHING_CELLS, dtype=torch.float64)
        wanted = min(COUNTED_WINDOWS, len(windows))
        chosen = torch.linspace(0, len(windows) - 1, wanted).round().long().to(windows.inputs.device)
        for part in torch.split(chosen, _BATCH):
            batch = shown(windows.batch(part))
            cells = self._rows(batch) * self._classes + batch.target
            counts += torch.bincount(cells[~batch.mask], minlength=counts.numel()).cpu().view_as(counts)
        log = counts.log()
        with torch.no_grad():
            self.table.copy_((log - log.amax(dim=1, keepdim=True)).clamp(min=FLOOR))

    def forward(self, batch: WindowBatch) -> Tensor:
        """Look every cell up: (B, C, H, W) float32 logits."""
        return nn.functional.embedding(self._rows(batch), self.table).permute(0, 3, 1, 2)

    def _rows(self, batch: WindowBatch) -> Tensor:
        """Number what the inputs show in each cell: (B, H, W) int64 rows of the table."""
        grids = newest_first(batch)
        newest = torch.zeros_like(grids[:, 0], dtype=torch.int64)
        before, age = newest.clone(), newest.clone()
        for place, grid in enumerate(grids.unbind(dim=1)):
            known, first = grid != UNKNOWN, newest == UNKNOWN
            before = torch.where(known & ~first & (before == UNKNOWN), grid, before)
            age = age.masked_fill(known & first, place)
            newest = torch.where(first, grid, newest)
        lead = batch.lead_s[:, -1] * (self._lead_bins / self._lead_span_s)
        bin_number = lead.long().clamp(0, self._lead_bins - 1)[:, None, None]
        return ((bin_number * grids.shape[1] + age) * self._classes + newest) * self._classes + before
