"""One grid as a plot in metres around the vehicle."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from semgrid_eval.classes import DEFAULT_CLASSES, MASK_COLOUR, ClassSet
from semgrid_eval.grids.spec import GridSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_grid(
    grid: NDArray[np.uint8],
    *,
    mask: NDArray[np.bool_] | None = None,
    spec: GridSpec | None = None,
    classes: ClassSet = DEFAULT_CLASSES,
    axes: "Axes | None" = None,
) -> "Axes":
    """Draw a grid (H, W) of class ids in the colour-blind-safe colours, mask M (H, W) in white.

    Without a spec the extent is the default one; without axes there is a new figure.
    """
    spec = spec or GridSpec(rows=grid.shape[0], columns=grid.shape[1])
    axes = Figure(layout="constrained").add_subplot() if axes is None else axes
    palette = np.vstack([classes.palette(safe=True), np.array([MASK_COLOUR], np.uint8)])
    shown = grid if mask is None else np.where(mask, classes.count, grid)
    left_m, right_m = spec.agent_column * spec.cell_m, (spec.agent_column - spec.columns) * spec.cell_m
    back_m, ahead_m = (spec.agent_row - spec.rows) * spec.cell_m, spec.agent_row * spec.cell_m
    axes.imshow(palette[shown], extent=(left_m, right_m, back_m, ahead_m), interpolation="nearest")
    axes.set(xlabel="left / m", ylabel="ahead / m")
    return axes
