"""The paper's class-wise table (supplement, Table A1) and its training, for comparison with a run."""

from functools import cache
from importlib import resources

import numpy as np
import pandas as pd

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.scores.metrics.iou import category_iou

PAPER_SETTINGS = {
    "settings.depth": ("depth", 3),
    "settings.features": ("features", 64),
    "settings.training.batch": ("batch", 32),
    "settings.training.epochs": ("epochs", 40),
    "settings.training.updates_per_epoch": ("updates an epoch", 185),
    "settings.training.schedule.learning_rate": ("learning rate", 1e-3),
    "settings.training.schedule.drop_epoch": ("learning rate dropped after epoch", 35),
    "settings.training.schedule.rate_after_drop": ("learning rate then", 1e-4),
}
"""What the supplement says of network and training: words and value by a result's setting."""
PAPER_DATASET = "cityscapes"
PAPER_REPEATS = 20
PAPER_WINDOWS = 500
"""One for each sequence of Cityscapes' validation set."""


def in_paper(name: str) -> bool:
    """Tell whether the paper's table has a row of that name."""
    return name in paper_table()


def paper_value(name: str, column: str) -> float:
    """Return the paper's value of a class or category for a row of that name, NaN where it has none."""
    return paper_table().get(name, {}).get(column, np.nan)


@cache
def paper_table() -> dict[str, dict[str, float]]:
    """Return the paper's values by row name and class; the categories follow as means of the classes (reading 11)."""
    with resources.files("semgrid_eval.report").joinpath("data/table_a1.csv").open("rb") as stream:
        table = pd.read_csv(stream, index_col="experiment")[list(CLASS_NAMES)]
    categories = category_iou(table.to_numpy(np.float64))
    whole = table.assign(**categories)
    return {str(name): {str(key): float(value) for key, value in row.items()} for name, row in whole.iterrows()}
