"""The divisions that every metric is reported by."""

from collections.abc import Callable, Sequence

from semgrid_eval.report.estimates.division import Division, of_cells
from semgrid_eval.report.estimates.paces import paces
from semgrid_eval.report.rows.load import Run
from semgrid_eval.scores.regions.table import PARTITIONS

OF_WINDOWS: dict[str, Callable[[Sequence[Run]], Division]] = {"paces": paces}
"""To add kinds of windows, add a line here; regions of cells stand in `scores.regions`."""


def divisions(runs: Sequence[Run]) -> list[Division]:
    """Return the divisions of cells, all cells first, and then those of windows."""
    return [*map(of_cells, PARTITIONS.values()), *(make(runs) for make in OF_WINDOWS.values())]
