"""Score a stream: at each time of evaluation the newest answer against what is measured then."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.models.model import Model
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores.evaluate import MaskMode, answered, apply_mask
from semgrid_eval.scores.metrics.metric import ScoredWindows
from semgrid_eval.scores.metrics.table import Sums, count_windows
from semgrid_eval.streams.plan import StreamPlan
from semgrid_eval.streams.schedule import NONE
from semgrid_eval.streams.shown import Arrays, FirstRecording
from semgrid_eval.windows.grids import GridData, shift_grids, shift_in_cells

Grids = NDArray[np.uint8]


@dataclass(frozen=True)
class StreamEvaluation:
    """What is left of a stream: what was counted in each block (B, regions, ...), and the time spent predicting."""

    sums: Sums
    seconds: float
    shown: Arrays  # what is kept to be looked at


def evaluate_stream(
    model: Model,
    plan: StreamPlan,
    *,
    spec: GridSpec,
    move: bool,
    mask_mode: MaskMode = "exclude",
    unseen: "Unseen | None" = None,
    batch: int = 16,
    progress: Progress = silent,
) -> StreamEvaluation:
    """Predict every answer that is used, and count it at each time at which it is the newest.

    Args:
        model: sees the past of a batch and its motion alone.
        plan: answers and when they are used.
        spec: extent of the grids.
        move: whether answers are moved from the vehicle's place at the time that they are for to its place at the time
            of evaluation.
        mask_mode: how the cells of M are treated, see `apply_mask`; M is `unseen_truth`.
        unseen: M, if it is worked out already.
        batch: windows at once.
        progress: told of each batch of evaluations.

    Raises:
        InputError: the model's answer is malformed.
    """
    shown = FirstRecording(plan)
    predictions = _Predictions(model, plan, batch, shown)
    data, blocks = plan.answers.data, plan.blocks()
    unseen = unseen or Unseen(data, plan.evaluated)
    total: dict[tuple[str, str], NDArray[np.int32]] = {}
    for start in range(0, len(plan.evaluated), batch):
        chosen = slice(start, start + batch)
        frames = plan.evaluated[chosen]
        prediction, certainty = predictions.at(plan.used[chosen], frames, move=move)
        target = data.grids[data.sensor_index(data.target), torch.from_numpy(frames).to(data.device)]
        truth = target.cpu().numpy()
        masked = unseen.at(chosen)
        shown.evaluate(truth, masked)
        answer, left_out = apply_mask(prediction, masked, mask_mode)
        scored = ScoredWindows(
            target=truth,
            prediction=answer,
            certainty=certainty,
            left_out=left_out,
            inputs=None,
            actors=data.actors_near(frames),
            spec=spec,
            classes=data.classes,
        )
        for key, counted in count_windows(scored).items():
            if key not in total:
                total[key] = np.zeros((int(blocks[-1]) + 1, *counted.shape[1:]), np.int32)
            np.add.at(total[key], blocks[chosen], counted)
        progress(min(start + batch, len(plan.evaluated)), len(plan.evaluated))
    return StreamEvaluation(total, predictions.seconds, shown.arrays())


class Unseen:
    """M at times of evaluation, worked out once for all rows of the same ones, a bit a cell."""

    def __init__(self, data: GridData, frames: NDArray[np.int64]) -> None:
        self._size = data.size
        parts = [unseen_truth(data, part) for part in np.array_split(frames, max(1, len(frames) // 64))]
        self._bits = np.packbits(np.concatenate(parts).reshape(len(frames), -1), axis=1)

    def at(self, chosen: slice) -> NDArray[np.bool_]:
        """Return M (E, H, W) at some of them."""
        cells = np.unpackbits(self._bits[chosen], axis=1, count=self._size[0] * self._size[1])
        return cells.reshape(-1, *self._size).view(np.bool_)


def unseen_truth(data: GridData, frames: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Compute M at times of evaluation: what any frame up to then has seen and the target does not know -> (E, H, W).

    It is the same whatever a row sees, when and how late. What was seen is moved to the vehicle's place, like grids.
    """
    row = data.sensor_index(data.target)
    found = np.zeros((len(frames), *data.size), np.bool_)
    for mask, frame, owner in zip(found, frames, data.locate(frames)[0], strict=True):
        first = int(data.first_frames[owner])
        moved_m = data.position_m[frame] - data.position_m[first : frame + 1]
        shift_cells = shift_in_cells(moved_m, data.cell_m)
        near = np.flatnonzero((np.abs(shift_cells) < data.size).all(axis=1))
        seen = data.grids[row, torch.from_numpy(first + near).to(data.device)] != UNKNOWN
        shifts = torch.from_numpy(shift_cells[near]).to(seen.device)
        known = shift_grids(seen.to(torch.uint8), shifts).amax(dim=0)
        mask[:] = ((known > 0) & (data.grids[row, frame] == UNKNOWN)).cpu().numpy()
    return found


class _Predictions:
    """The answers of a model, predicted in batches in the order of their use, which never turns back, and forgotten."""

    def __init__(self, model: Model, plan: StreamPlan, batch: int, shown: FirstRecording) -> None:
        self._model, self._plan, self._batch, self._shown = model, plan, batch, shown
        self._first = 0  # number of the first answer that is held
        self._held: list[tuple[Grids, Grids]] = []
        self.seconds = 0.0

    def at(self, used: NDArray[np.int64], frames: NDArray[np.int64], *, move: bool) -> tuple[Grids, Grids]:
        """Return class ids and certainty (E, H, W) of the answers used at some frames; all unknown where none is."""
        size = self._plan.answers.data.size
        prediction, certainty = (np.zeros((len(used), *size), np.uint8) for _ in range(2))
        there = used != NONE
        if there.any():
            classes, levels = self._answers(used[there])
            if move:
                data = self._plan.answers.data
                moved_m = data.position_m[frames[there]] - self._plan.target_m[used[there]]
                shifts = torch.from_numpy(shift_in_cells(moved_m, data.cell_m))
                classes, levels = (shift_grids(torch.from_numpy(each), shifts).numpy() for each in (classes, levels))
            prediction[there], certainty[there] = classes, levels
        return prediction, certainty

    def _answers(self, numbers: NDArray[np.int64]) -> tuple[Grids, Grids]:
        """Return some answers; those from the first of them on stay at hand, and what is missing there is predicted."""
        first, last = int(numbers.min()), int(numbers.max())
        self._first, self._held = first, self._held[first - self._first :]
        for start in range(first + len(self._held), last + 1, self._batch):
            seen = self._plan.answers.batch(slice(start, min(start + self._batch, last + 1)))
            answer = answered(self._model, seen)
            self.seconds += answer.seconds
            self._shown.answer(answer.prediction, answer.certainty)
            self._held += zip(answer.prediction, answer.certainty, strict=True)
        classes, levels = zip(*(self._held[number - first] for number in numbers), strict=True)
        return np.stack(classes), np.stack(levels)
