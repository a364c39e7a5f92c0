"""What is kept of a stream to be looked at: the first recording, with all answers that were used in it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.streams.plan import StreamPlan, positions_at

Arrays = dict[str, NDArray[Any]]


class FirstRecording:
    """Collects what is shown of the first recording of a plan, while all of it is evaluated."""

    def __init__(self, plan: StreamPlan) -> None:
        owners, _ = plan.answers.data.locate(plan.evaluated)
        self._plan, self._owner = plan, int(owners[0])
        self._evaluations = int((owners == owners[0]).sum())
        self._answers = int(plan.used[: self._evaluations].max()) + 1
        nothing = np.zeros((0, *plan.answers.data.size), np.uint8)
        self._parts = {name: [nothing] for name in ("prediction", "certainty", "target", "mask")}

    def answer(self, prediction: NDArray[np.uint8], certainty: NDArray[np.uint8]) -> None:
        """Take the next answers (B, H, W) of the plan."""
        self._take(self._answers, {"prediction": prediction, "certainty": certainty})

    def evaluate(self, target: NDArray[np.uint8], mask: NDArray[np.bool_]) -> None:
        """Take the next times of evaluation: target and M (B, H, W)."""
        self._take(self._evaluations, {"target": target, "mask": mask.astype(np.uint8)})

    def arrays(self) -> Arrays:
        """Return grids, times in ns and positions of the vehicle in m, by names as `scores.results` lists them."""
        plan, data = self._plan, self._plan.answers.data
        own = slice(data.first_frames[self._owner], data.first_frames[self._owner + 1])
        made, evaluated = slice(0, self._answers), plan.evaluated[: self._evaluations]
        return {
            **{name: np.concatenate(parts) for name, parts in self._parts.items()},
            "for_ns": plan.for_ns[made],
            "capture_ns": plan.capture_ns[made],
            "publish_ns": plan.publish_ns[made],
            "answer_m": plan.target_m[made],
            "publish_m": positions_at(plan.publish_ns[made], data.stamps_ns[own], data.position_m[own]),
            "evaluated_ns": data.stamps_ns[evaluated],
            "evaluated_m": data.position_m[evaluated],
            "used": plan.used[: self._evaluations],
        }

    def _take(self, count: int, found: dict[str, NDArray[np.uint8]]) -> None:
        for name, part in found.items():
            left = count - sum(map(len, self._parts[name]))
            if left > 0:
                self._parts[name].append(part[:left].copy())
