"""Stand-in until the merge."""  # ruff: noqa: D101, D102, D103

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


class LatencyProfile:
    def chain_ms(self, model: str | None) -> NDArray[np.float64]:
        raise NotImplementedError

    def draw_ns(self, model: str | None, count: int, *, seed: int, scale: float = 1.0) -> NDArray[np.int64]:
        raise NotImplementedError


def read_profile(path: Path) -> LatencyProfile:
    raise NotImplementedError
