"""How sure a network says it is: set after its training, so that its certainty is the share of cells it has right."""

from collections.abc import Callable, Iterator

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from semgrid_eval.windows.data import WindowBatch, WindowSet

FITTED_WINDOWS = 256  # at most, spread evenly over the training windows
_EDGE = 1e-6  # of probabilities, so that their logits are finite
_STEPS = 100
_BATCH = 8


class Certainty(nn.Module):
    """Platt's scaling (1999) of the highest probability of each cell, by the class that is predicted there.

    Losses over regions, like Jaccard's, and long trainings make a network surer than it is right. All scores of a cell
    are scaled alike, so the predicted class stays what it was, and with it every score but those of the certainty.
    """

    slope: Tensor  # (C,) of the probability's logit
    offset: Tensor  # (C,)

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.register_buffer("slope", torch.ones(classes))
        self.register_buffer("offset", torch.zeros(classes))

    def forward(self, probabilities: Tensor) -> Tensor:
        """Scale scores (B, C, H, W) so that the highest of a cell is the share of right cells expected there."""
        highest, predicted = probabilities.max(dim=1, keepdim=True)
        logit = torch.logit(highest.clamp(_EDGE, 1 - _EDGE))
        certainty = torch.sigmoid(self.slope[predicted] * logit + self.offset[predicted])
        return probabilities * (certainty / highest)

    def fit(self, probabilities: Callable[[WindowBatch], Tensor], windows: WindowSet) -> None:
        """Fit both numbers of each class to what a trained network has right in training windows outside M.

        Args:
            probabilities: the network's answer to a batch, (B, C, H, W), not scaled.
            windows: those that it was trained on.
        """
        logits, predicted, right = (torch.cat(part) for part in zip(*_answers(probabilities, windows), strict=True))
        for each in range(len(self.slope)):
            here = predicted == each
            if here.any():
                slope, offset = _fitted(logits[here].double(), right[here].double())
                self.slope[each], self.offset[each] = slope, offset


def _answers(
    probabilities: Callable[[WindowBatch], Tensor], windows: WindowSet
) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    """Return the highest probability's logit of the cells outside M, its class, and whether it is right: (K,) each."""
    count = min(FITTED_WINDOWS, len(windows))
    chosen = torch.linspace(0, len(windows) - 1, count).round().long().to(windows.inputs.device)
    for part in torch.split(chosen, _BATCH):
        batch = windows.batch(part)
        highest, predicted = probabilities(batch).max(dim=1)
        counted = ~batch.mask
        right = (predicted == batch.target)[counted]
        logit = torch.logit(highest.clamp(_EDGE, 1 - _EDGE))[counted]
        yield logit.cpu(), predicted[counted].cpu(), right.cpu()


def _fitted(logit: Tensor, right: Tensor) -> tuple[float, float]:
    """Fit slope and offset by the likelihood of what is right, smoothed by Platt's two cells."""
    hits = right.sum()
    wanted = torch.where(right > 0, (hits + 1) / (hits + 2), 1 / (len(right) - hits + 2))
    grown = torch.zeros(2, dtype=torch.float64, requires_grad=True)  # the slope's logarithm: it stays positive
    optimizer = torch.optim.LBFGS([grown], max_iter=_STEPS, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        optimizer.zero_grad()
        value = F.binary_cross_entropy_with_logits(grown[0].exp() * logit + grown[1], wanted)
        value.backward()  # type: ignore[no-untyped-call]
        return value

    optimizer.step(loss)  # type: ignore[no-untyped-call]
    slope, offset = grown.detach()
    return float(slope.exp()), float(offset)
