"""What rows are told of the truth: asked of each scored log, some at a time, and put together window by window."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from semgrid_eval.errors import SemgridError, UnknownTruthError
from semgrid_eval.executors import Executor
from semgrid_eval.grids.draws import Draws
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.grids.truth import Question, Truth, WindowTimes
from semgrid_eval.models.votes import likeliest
from semgrid_eval.progress import Stage
from semgrid_eval.windows.data import WindowSet

EXPECTED = Draws(15, continued=False)
"""What makes the expected target: the class of each cell that most draws of new errors have."""


class Part(NamedTuple):
    """The windows of one log, as indices, and what is asked of it."""

    windows: NDArray[np.int64]
    question: Question


def parts_of(truth: Truth, windows: WindowSet, config: GridConfig) -> Iterator[Part]:
    """Divide what is asked of windows by their logs."""
    data = windows.data
    targets, inputs = windows.target_frames.cpu().numpy(), windows.inputs.cpu().numpy()
    owners, _ = data.locate(targets)
    first_ns = data.stamps_ns[data.first_frames[owners]]
    digests = dict(zip(data.logs, data.digests, strict=True))
    place = {log: number for number, log in enumerate(digests)}
    log_of = np.array([place[log] for log in data.logs])[owners]
    begins = np.cumsum(np.bincount(log_of, minlength=len(digests)))[:-1]
    chosen_of = np.split(np.argsort(log_of, kind="stable"), begins)
    for (log, digest), chosen in zip(digests.items(), chosen_of, strict=True):
        if len(chosen):
            times = WindowTimes(first_ns[chosen], data.stamps_ns[inputs[chosen]], data.stamps_ns[targets[chosen]])
            yield Part(chosen, Question(truth, Path(log), digest, config, times))


def work_out(questions: Iterable[Question], cache: Path, executor: Executor, stage: Stage) -> None:
    """Answer what is not answered yet, as many logs at once as the executor works on; rows will say what failed."""
    missing = {path: each for each in questions if not (path := each.file(cache)).is_file()}
    if missing:
        waiting = list(missing.values())
        with stage("truth") as progress:
            for done, (index, _) in enumerate(executor.run(partial(_try, cache=cache), waiting), start=1):
                progress(done, len(waiting), waiting[index].log.stem)


def _try(question: Question, cache: Path) -> None:
    """Keep the answer for whoever needs it; what fails fails again, and is told, when a row asks."""
    with suppress(SemgridError):
        question.answer(cache)


def told(truth: Truth, windows: WindowSet, config: GridConfig, cache: Path | None) -> Tensor:
    """Answer for all windows: (N, ...) on the device of the grids; there is no `cache` where there are no logs.

    Raises:
        UnknownTruthError: a log does not hold that truth, or there are none, as beside packed grids.
    """
    if cache is None:
        raise UnknownTruthError("packed grids do not hold the truth, only their logs do")
    found: NDArray[Any] | None = None
    for chosen, question in parts_of(truth, windows, config):
        answer = question.answer(cache)
        if found is None:
            found = np.zeros((len(windows), *answer.shape[1:]), answer.dtype)
        found[chosen] = answer
    assert found is not None, "there are windows"
    return torch.from_numpy(found).to(windows.data.device)


def expected_target(windows: WindowSet, config: GridConfig, cache: Path | None) -> NDArray[np.uint8] | None:
    """Return what is measured on average at the windows' targets, (N, H, W); None where a log does not tell."""
    try:
        votes = told(EXPECTED, windows, config, cache)
    except UnknownTruthError:
        return None
    return torch.cat([likeliest(part).argmax(dim=1).to(torch.uint8) for part in torch.split(votes, 64)]).cpu().numpy()
