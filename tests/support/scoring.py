from collections.abc import Iterable

import numpy as np

from semgrid_eval.report.estimates.bootstrap import DRAWS, Resampling, Scores, score_everywhere
from semgrid_eval.report.rows.load import Row
from semgrid_eval.scores.metrics.table import IOU


def score_rows(rows: Iterable[Row], seed: int | np.random.Generator, *, draws: int = DRAWS) -> Scores:
    """Score rows by name by the IoU of all cells; rows without windows are left out."""
    return score_everywhere(rows, IOU, Resampling(seed, draws))
