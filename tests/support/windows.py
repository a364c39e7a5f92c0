"""Windows as metrics see them, with random cells."""

import numpy as np

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.scores.metrics.metric import ScoredWindows

SPEC = GridSpec(rows=10, columns=12, cell_m=9.0, agent_row=10, agent_column=6)


def random_windows(seed: int, *, windows: int = 3, classes: int = CLASS_COUNT, actors: bool = True) -> ScoredWindows:
    """Make windows of a small grid with large cells, so that every band of distance has some."""
    generator = np.random.default_rng(seed)
    shape = (windows, SPEC.rows, SPEC.columns)
    draw = {
        name: generator.integers(0, high, shape).astype(np.uint8)
        for name, high in (("target", classes), ("prediction", classes), ("certainty", 256), ("actors", 4))
    }
    inputs = generator.integers(0, classes, (windows, 2, 3, *shape[1:])) * (
        generator.random((windows, 2, 3, *shape[1:])) < 0.2
    )
    flags = draw.pop("actors")
    return ScoredWindows(
        **draw,
        left_out=generator.random(shape) < 0.3,
        inputs=inputs.astype(np.uint8),
        actors=flags if actors else None,
        spec=SPEC,
    )
