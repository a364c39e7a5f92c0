"""Predict once: run a predictor over all windows and keep counts, classes and certainty."""

import time
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_eval.errors import InputError
from semgrid_eval.models.predictor import Predictor
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores.iou import Counts, confusion
from semgrid_eval.sequences.dataset import WindowSet


@dataclass(frozen=True)
class Evaluation:
    """What is left of a predictor's answers.

    Args:
        counts: (N, C, C) cells by target and predicted class, mask M left out.
        prediction: (N, H, W) uint8 class ids.
        certainty: (N, H, W) uint8, the highest score of each cell, 255 = 1.
        seconds: time spent predicting, without gathering inputs.
    """

    counts: Counts
    prediction: NDArray[np.uint8]
    certainty: NDArray[np.uint8]
    seconds: float


def evaluate(predictor: Predictor, windows: WindowSet, *, batch: int = 16, progress: Progress = silent) -> Evaluation:
    """Score a predictor over all windows, in order.

    Raises:
        InputError: there is no window, or the predictor's answer is malformed.
    """
    if not len(windows):
        raise InputError("there is no window to score")
    counts, predictions, certainties = [], [], []
    seconds = 0.0
    for part in windows.batches(batch):
        start_s = time.perf_counter()
        with torch.inference_mode():
            certainty, prediction = predictor(part).max(dim=1)
            answer = prediction.to(torch.uint8).cpu().numpy()
        seconds += time.perf_counter() - start_s
        predictions.append(answer)
        certainties.append((certainty.float().clamp(0, 1) * 255).round().to(torch.uint8).cpu().numpy())
        counts.append(confusion(part.target.cpu().numpy(), answer, part.mask.cpu().numpy()))
        progress(sum(map(len, predictions)), len(windows))
    return Evaluation(np.concatenate(counts), np.concatenate(predictions), np.concatenate(certainties), seconds)
