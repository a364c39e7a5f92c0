"""Predict once: run a model over all windows and keep what metrics counted, classes and certainty."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.errors import InputError
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.models.model import Model, require_answer, require_scores
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores.metrics.metric import ScoredWindows
from semgrid_eval.scores.metrics.table import Sums, count_windows
from semgrid_eval.windows.data import WindowBatch, WindowSet

MaskMode = Literal["exclude", "substitute", "off"]


@dataclass(frozen=True)
class Evaluation:
    """What is left of a model's answers."""

    sums: Sums  # what every metric counted, (N, regions, ...), by the names of metric and partition
    prediction: NDArray[np.uint8]  # (N, H, W) uint8 class ids
    certainty: NDArray[np.uint8]  # (N, H, W) uint8, the highest score of each cell, 255 = 1
    seconds: float  # time spent predicting, without gathering inputs
    expected_sums: Sums | None = None  # what was counted against the expected target, where there is one
    stream: dict[str, NDArray[Any]] | None = None  # of a stream, instead of all answers, what is kept to be looked at


def evaluate(
    model: Model,
    windows: WindowSet,
    *,
    mask_mode: MaskMode = "exclude",
    spec: GridSpec | None = None,
    expected: NDArray[np.uint8] | None = None,
    batch: int = 16,
    progress: Progress = silent,
) -> Evaluation:
    """Score a model over all windows, in order, by every metric.

    Args:
        model: sees the past of a batch and its motion alone.
        windows: what is scored.
        mask_mode: how the cells of M are treated, see `apply_mask`.
        spec: extent of the grids; by default the vehicle is at the middle of the bottom edge.
        expected: a second target (N, H, W) that the same predictions are scored against.
        batch: windows at once.
        progress: told of each batch.

    Raises:
        InputError: there is no window, or the predictor's answer is malformed.
    """
    if not len(windows):
        raise InputError("there is no window to score")
    spec = spec or _usual_spec(windows)
    parts = []
    if windows.target_frames.is_cuda:  # the first call loads kernels
        with torch.inference_mode():
            model.predict(_without_answer(windows.batch(slice(batch))))
    for start in range(0, len(windows), batch):
        chosen = slice(start, start + batch)
        seen = windows.batch(chosen)
        answer = answered(model, seen)
        prediction, left_out = apply_mask(answer.prediction, seen.mask.cpu().numpy(), mask_mode)
        # What was to be seen, whichever way a row sees it.
        plain = windows.translate and not windows.disturb
        aligned = seen if plain else replace(windows, translate=True, disturb=None).batch(chosen)
        target, inputs, actors = seen.target.cpu().numpy(), aligned.past.cpu().numpy(), windows.actors(chosen)
        scored = ScoredWindows(
            target=target,
            prediction=prediction,
            certainty=answer.certainty,
            left_out=left_out,
            inputs=inputs,
            actors=actors,
            spec=spec,
            classes=windows.data.classes,
        )
        counted = replace(answer, sums=count_windows(scored))
        if expected is not None:
            second = _against(expected[chosen], scored, answer.prediction, mask_mode)
            counted = replace(counted, expected_sums=count_windows(second))
        parts.append(counted)
        progress(min(start + batch, len(windows)), len(windows))
    return Evaluation(
        _joined([part.sums for part in parts]),
        np.concatenate([part.prediction for part in parts]),
        np.concatenate([part.certainty for part in parts]),
        sum(part.seconds for part in parts),
        None if expected is None else _joined([part.expected_sums or {} for part in parts]),
    )


def _joined(parts: Sequence[Sums]) -> Sums:
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _against(
    target: NDArray[np.uint8], scored: ScoredWindows, answer: NDArray[np.uint8], mask_mode: MaskMode
) -> ScoredWindows:
    """Put another target in the place of what was measured, and make M anew: what was seen and it does not know."""
    assert scored.inputs is not None
    seen = (scored.inputs != UNKNOWN).any(axis=(1, 2))
    prediction, left_out = apply_mask(answer, seen & (target == UNKNOWN), mask_mode)
    return replace(scored, target=target, prediction=prediction, left_out=left_out)


def answered(model: Model, seen: WindowBatch) -> Evaluation:
    """Ask a model about a batch, and measure the time; nothing is counted yet.

    Raises:
        InputError: the answer is malformed.
    """
    if seen.target.is_cuda:  # what is still being gathered there is not the predictor's time
        torch.cuda.synchronize(seen.target.device)
    start_s = time.perf_counter()
    with torch.inference_mode():
        scores = require_answer(model.predict(_without_answer(seen)), seen, model)
        certainty, prediction = scores.max(dim=1)
        answer = prediction.to(torch.uint8).cpu().numpy()
    seconds = time.perf_counter() - start_s
    require_scores(scores, seen, model)
    levels = (certainty.float().clamp(0, 1) * 255).round().to(torch.uint8).cpu().numpy()
    return Evaluation({}, answer, levels, seconds)


def _usual_spec(windows: WindowSet) -> GridSpec:
    rows, columns = windows.data.size
    cell_m = windows.data.cell_m
    return GridSpec(rows=rows, columns=columns, cell_m=cell_m, agent_row=rows, agent_column=columns // 2)


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
