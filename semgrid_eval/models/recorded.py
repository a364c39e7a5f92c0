"""Predictions made elsewhere, by a node on a vehicle or a bench: found in logs, and scored like any other row."""

import torch
from pydantic import Field
from torch import Tensor

from semgrid_eval.config import Config
from semgrid_eval.errors import InputError
from semgrid_eval.models.model import AnswersIn, Model, one_hot
from semgrid_eval.windows.data import WindowBatch


class RecordedSettings(Config):
    """Where predictions are."""

    folder: str = Field(min_length=1)  # of logs, one for each recording
    topic: str | None = Field(None, min_length=1)  # in them; where there is one of grids alone, it need not be named


class Recorded(Model):
    """Answers with what a log holds for a window."""

    Settings = RecordedSettings
    family = "Log"
    files = ()

    @classmethod
    def in_words(cls, settings: RecordedSettings) -> str:
        """Say where its answers are from."""
        return f"predictions of {settings.folder}"

    @classmethod
    def answers_in(cls, settings: RecordedSettings) -> AnswersIn:
        """Say where they are."""
        return AnswersIn(settings.folder, settings.topic)

    def predict(self, batch: WindowBatch) -> Tensor:
        """Return the certainty of the class that was predicted, and less than nothing of all others: (B, C, H, W).

        So a class is the same again even where its certainty is 0.

        Raises:
            InputError: there are no answers; only a run reads them.
        """
        if batch.answers is None:
            raise InputError("its answers are in logs, which only `semgrid-eval run` reads", field=self.called)
        classes, certainty = batch.answers.to(batch.past.device).unbind(dim=1)
        return torch.where(one_hot(classes, self.given.classes.count) > 0, certainty[:, None].float() / 255, -1.0)
