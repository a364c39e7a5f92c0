"""A model made ready to predict: built, and fitted or trained if it learns."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Self

import torch

from semgrid_eval.config import Config
from semgrid_eval.models.memory import require_room
from semgrid_eval.models.model import Given, Model, parameter_count
from semgrid_eval.models.network import Network, seeded_network
from semgrid_eval.models.training import train
from semgrid_eval.progress import Progress, silent
from semgrid_eval.windows.data import WindowBatch, WindowSet


@dataclass(frozen=True)
class Lesson:
    """What a model is given, what it learns from, and where."""

    given: Given
    seed: int
    device: torch.device
    windows: WindowSet | None = None  # to learn from; None where it does not learn
    watched: WindowSet | None = None  # whose loss a network's training notes
    folder: Path | None = None  # of a network's training

    def with_windows_on(self, device: torch.device) -> Self:
        """Return the same lesson with its windows on a device, which may be another than that of the model."""
        windows, watched = self.windows and self.windows.to(device), self.watched and self.watched.to(device)
        return replace(self, windows=windows, watched=watched)


@dataclass(frozen=True)
class Fitted:
    """A model that is ready to predict."""

    model: Model
    parameters: int | None  # trained values of a torch module
    epochs_s: tuple[float, ...] | None = None  # time of each epoch that gradients have trained it

    @property
    def train_seconds(self) -> float | None:
        """Time that gradients have trained it."""
        return None if self.epochs_s is None else round(sum(self.epochs_s), 3)


def fit_model(made: type[Model], settings: Config, lesson: Lesson, progress: Progress = silent) -> Fitted:
    """Make a model and let it learn; chance comes from torch's generators, as the caller has seeded them.

    Raises:
        InputError: its training needs more memory than there is, or its folder is another training's.
        DivergedError: the loss is no longer a number.
    """
    if issubclass(made, Network) and lesson.windows is not None and lesson.folder is not None:
        require_room(made, settings, lesson.given, lesson.device)
        network = seeded_network(made, settings, lesson.given, lesson.seed)
        train_it = partial(train, network, lesson.windows, seed=lesson.seed, device=lesson.device)
        trained = train_it(folder=lesson.folder, progress=progress, validation=lesson.watched)
        return Fitted(trained.network, parameter_count(network), tuple(epoch.seconds for epoch in trained.history))
    model = made(settings, lesson.given)
    if isinstance(model, torch.nn.Module):
        model.to(lesson.device).eval()
    if lesson.windows is not None:
        model.fit(lesson.windows)
    return Fitted(model, parameter_count(model))


def batch_on(batch: WindowBatch, device: torch.device) -> WindowBatch:
    """Return a batch with all its tensors on a device."""
    names = ("past", "shift_cells", "lead_s", "target", "mask")
    told = {name: each.to(device) for name in ("truth", "answers") if (each := getattr(batch, name)) is not None}
    return replace(batch, **told, **{name: getattr(batch, name).to(device) for name in names})
