"""A recording that plays as answers come: at each time of evaluation what is measured, and what each strategy has."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import UNKNOWN, ClassSet
from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.estimates.streams import Strategy, facts_of, plain_strategy
from semgrid_eval.report.examples.drawing import Frame, Grid, strip_picture
from semgrid_eval.report.examples.reel import MOST_MOMENTS, Reel, Strip, moments_since
from semgrid_eval.report.rows.load import Row
from semgrid_eval.report.rows.pairing import HEADLINE
from semgrid_eval.scores.results import read_stream

_MOST_STRATEGIES = 3
_HINT = (
    "The first recording, at times of evaluation that follow each other: what is measured then, mask M in white, and "
    "the newest grid that each strategy has published, moved along with the vehicle where it does so."
)


def stream_reel(found: Sequence[Strategy], classes: ClassSet) -> Reel | None:
    """Draw the newest grid as it is and the best other strategies; None where there is nothing to show."""
    rows = _shown(found)
    try:
        kept = [(row, read_stream(row.results[0].folder)) for row in rows]
    except (SemgridError, ValueError):  # `failures` names what is damaged
        return None
    if not kept:
        return None
    first = kept[0][1]
    start = max(0, len(first["evaluated_ns"]) - MOST_MOMENTS) // 2
    moments = range(start, min(start + MOST_MOMENTS, len(first["evaluated_ns"])))
    measured = [Frame(first["target"][at], first["mask"][at] > 0) for at in moments]
    columns: list[tuple[str, Sequence[Frame | None]]] = [("Measured", measured)]
    columns += [(row.name, _answers(row, arrays, moments)) for row, arrays in kept]
    recording = rows[0].results[0].record.windows[0].recording
    return Reel(
        "A recording, time by time",
        _HINT,
        ((), *((row.number,) for row in rows)),
        moments_since([int(first["evaluated_ns"][at]) for at in moments]),
        (Strip(recording, tuple(strip_picture(name, frames, classes) for name, frames in columns)),),
    )


def _shown(found: Sequence[Strategy]) -> list[Row]:
    """Choose the rows of strategies on one set of targets: the newest grid as it is, then the best."""
    plain = plain_strategy(found)
    usual = [each for each in found if not (each.measured.row.uses_truth or each.measured.row.is_oracle)]
    ordered = sorted(usual, key=lambda each: (each is not plain, -each.measured.mean[HEADLINE]))
    rows = [each.measured.row for each in ordered]
    return [row for row in rows if row.targets == rows[0].targets][:_MOST_STRATEGIES]


def _answers(row: Row, arrays: Mapping[str, NDArray[Any]], moments: Sequence[int]) -> list[Frame | None]:
    cell_m = (row.results[0].grid or GridConfig()).spec.cell_m

    def at(moment: int) -> Frame | None:
        if (used := arrays["used"][moment]) < 0:
            return None
        way_m = arrays["evaluated_m"][moment] - arrays["answer_m"][used] if facts_of(row).moved else np.zeros(2)
        return Frame(moved(arrays["prediction"][used], np.rint(way_m / cell_m).astype(np.int64)))

    return [at(moment) for moment in moments]


def moved(grid: Grid, cells: NDArray[np.int64]) -> Grid:
    """Move a grid (H, W) down and to the right by whole cells (2,); what enters is unknown."""
    found = np.full_like(grid, UNKNOWN)
    (down, right), (rows, columns) = np.clip(cells, -np.array(grid.shape), grid.shape), grid.shape
    into = slice(max(down, 0), rows + min(down, 0)), slice(max(right, 0), columns + min(right, 0))
    found[into] = grid[max(-down, 0) : rows - max(down, 0), max(-right, 0) : columns - max(right, 0)]
    return found
