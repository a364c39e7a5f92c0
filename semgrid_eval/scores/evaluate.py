"""Predict once: run a predictor over all windows and keep counts, classes and certainty."""

import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import InputError
from semgrid_eval.grids.spec import MOVING, STANDING
from semgrid_eval.models.model import Model
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores.iou import Counts, confusion
from semgrid_eval.windows.data import WindowBatch, WindowSet

MaskMode = Literal["exclude", "substitute", "off"]


@dataclass(frozen=True)
class Evaluation:
    """What is left of a predictor's answers.

    Args:
        counts: (N, C, C) cells by target and predicted class, mask M treated as asked.
        region_counts: the same of cells near `moving` and near `standing` actors alone; empty without the truth.
        prediction: (N, H, W) uint8 class ids.
        certainty: (N, H, W) uint8, the highest score of each cell, 255 = 1.
        seconds: time spent predicting, without gathering inputs.
    """

    counts: Counts
    region_counts: dict[str, Counts]
    prediction: NDArray[np.uint8]
    certainty: NDArray[np.uint8]
    seconds: float


def evaluate(
    model: Model,
    windows: WindowSet,
    *,
    mask_mode: MaskMode = "exclude",
    batch: int = 16,
    progress: Progress = silent,
) -> Evaluation:
    """Score a predictor over all windows, in order.

    Raises:
        InputError: there is no window, or the predictor's answer is malformed.
    """
    if not len(windows):
        raise InputError("there is no window to score")
    counts, predictions, certainties = [], [], []
    region_counts: dict[str, list[Counts]] = {}
    seconds = 0.0
    if windows.target_frames.is_cuda:  # the first call loads kernels
        with torch.inference_mode():
            model.predict(_without_answer(windows.batch(slice(batch))))
    for start in range(0, len(windows), batch):
        chosen = slice(start, start + batch)
        part = windows.batch(chosen)
        if part.target.is_cuda:  # what is still being gathered there is not the predictor's time
            torch.cuda.synchronize(part.target.device)
        start_s = time.perf_counter()
        with torch.inference_mode():
            certainty, prediction = model.predict(_without_answer(part)).max(dim=1)
            answer = prediction.to(torch.uint8).cpu().numpy()
        seconds += time.perf_counter() - start_s
        predictions.append(answer)
        certainties.append((certainty.float().clamp(0, 1) * 255).round().to(torch.uint8).cpu().numpy())
        target, mask = part.target.cpu().numpy(), part.mask.cpu().numpy()
        scored, left_out = apply_mask(answer, mask, mask_mode)
        counts.append(confusion(target, scored, left_out))
        for name, region in actor_regions(windows.actors(chosen)).items():
            region_counts.setdefault(name, []).append(confusion(target, scored, left_out | ~region))
        progress(sum(map(len, predictions)), len(windows))
    return Evaluation(
        np.concatenate(counts),
        {name: np.concatenate(parts) for name, parts in region_counts.items()},
        np.concatenate(predictions),
        np.concatenate(certainties),
        seconds,
    )


def _without_answer(batch: WindowBatch) -> WindowBatch:
    """Hide the target and the mask: a predictor sees past and motion only, and can change nothing of what is scored."""
    return replace(
        batch,
        target=torch.zeros_like(batch.target),
        mask=torch.zeros_like(batch.mask),
        shift_cells=batch.shift_cells.clone(),  # a view of what other rows see, too; likewise the next
        lead_s=batch.lead_s.clone(),
    )


def apply_mask(
    prediction: NDArray[np.uint8], mask: NDArray[np.bool_], mode: MaskMode
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Treat the cells of M (N, H, W) as reading 9 says: return the prediction to score and the cells to leave out.

    `exclude` leaves them out, `substitute` counts them as correctly unknown, `off` scores them like any other.
    """
    if mode == "exclude":
        return prediction, mask
    scored = np.where(mask, np.uint8(UNKNOWN), prediction) if mode == "substitute" else prediction
    return scored, np.zeros_like(mask)


def actor_regions(actors: NDArray[np.uint8] | None) -> dict[str, NDArray[np.bool_]]:
    """Split flags (N, H, W) into the cells near moving and near standing actors; cells near both are moving."""
    if actors is None:
        return {}
    moving = (actors & MOVING) != 0
    return {"moving": moving, "standing": ((actors & STANDING) != 0) & ~moving}
