"""The paper's class-wise table (supplement, Table A1), to stand beside a run's values."""

from functools import cache
from importlib import resources

import numpy as np
import pandas as pd

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.scores.iou import category_iou


@cache
def paper_table() -> dict[str, dict[str, float]]:
    """Return the paper's values by row name and class; the categories follow as means of the classes (reading 11)."""
    with resources.files("semgrid_eval.report").joinpath("data/table_a1.csv").open("rb") as stream:
        table = pd.read_csv(stream, index_col="experiment")[list(CLASS_NAMES)]
    categories = category_iou(table.to_numpy(np.float64))
    whole = table.assign(**categories)
    return {str(name): {str(key): float(value) for key, value in row.items()} for name, row in whole.iterrows()}
