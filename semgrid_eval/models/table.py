"""BL-Table: probabilities of a cell's class given the classes that the inputs show there, counted in training."""

import torch
from torch import Tensor

from semgrid_eval.models.model import Baseline
from semgrid_eval.models.overlay import newest_first
from semgrid_eval.windows.data import WindowBatch, WindowSet

GRID_LIMIT = 5  # grids that a table looks at, the newest ones: it has C to the power of their number rows
SIZE_LIMIT = 10**6  # of its counts, one for each row and class of the target; of many classes it looks at fewer grids
SMOOTHING_CELLS = 50.0  # how many cells of what fewer grids suggest are added to the counts of each row
BATCH = 64  # windows that are counted at once


class ClassTable(Baseline):
    """A table over the newest K grids; a row's index has the newest grid's class as its first digit."""

    words = "likeliest class given the inputs' classes in the cell, counted on the training windows"
    _probability: Tensor  # (C ** K, C) of each target class

    @property
    def _grids(self) -> int:
        fitting = (grids for grids in range(1, GRID_LIMIT + 1) if self._classes ** (grids + 1) <= SIZE_LIMIT)
        return min(self.given.grids, max(fitting))

    @property
    def _classes(self) -> int:
        return self.given.classes.count

    def fit(self, windows: WindowSet) -> None:
        """Count the target's classes over all cells outside M of training windows."""
        size = self._classes ** (self._grids + 1)
        counts = torch.zeros(size, dtype=torch.int64)
        for part in windows.batches(BATCH):
            index = self._rows(part) * self._classes + part.target
            counts += torch.bincount(index[~part.mask], minlength=size).cpu()
        self._probability = _smoothed(counts.view([self._classes] * (self._grids + 1)).double()).float()

    def predict(self, batch: WindowBatch) -> Tensor:
        """Look every cell up: (B, C, H, W)."""
        table = self._probability.to(batch.past.device)
        return table[self._rows(batch)].permute(0, 3, 1, 2)

    def _rows(self, batch: WindowBatch) -> Tensor:
        """Number the classes of the newest grids, newest first and sensors in order: (B, H, W) int64."""
        rows = torch.zeros_like(batch.target, dtype=torch.int64)
        for grid in newest_first(batch)[:, : self._grids].unbind(dim=1):
            rows = rows * self._classes + grid
        return rows


def _smoothed(counts: Tensor) -> Tensor:
    """Turn counts (C, ..., C), inputs then target, into probabilities (rows, C).

    A row that was seen seldom leans on the same row without its oldest grid, and so on down to the bare frequencies.
    """
    marginals = [counts]
    while marginals[-1].ndim > 1:
        marginals.append(marginals[-1].sum(dim=-2))
    prior = torch.tensor(1 / counts.shape[-1], dtype=counts.dtype)
    for seen in reversed(marginals):
        cells = seen.sum(dim=-1, keepdim=True) + SMOOTHING_CELLS
        prior = ((seen + SMOOTHING_CELLS * prior) / cells).unsqueeze(-2)
    return prior.reshape(-1, counts.shape[-1])
