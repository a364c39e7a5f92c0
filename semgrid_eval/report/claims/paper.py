"""The paper's class-wise table (supplement, Table A1), and how a run's trainings differ from its own."""

from collections.abc import Iterable
from functools import cache
from importlib import resources

import numpy as np
import pandas as pd

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.report.rows.load import Run
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


def scaling(run: Run) -> str:
    """Say how the training of rows that the paper has, too, differs from the paper's; empty if none was trained."""
    rows = [row for row in run.rows if row.results and in_paper(row.record.name)]
    trained = [row for row in rows if row.results[0].record.seed is not None]
    if not trained:
        return ""
    settings = [result.settings for row in trained for result in row.results]
    found = [
        _difference(text, {each[key] for each in settings if key in each}, theirs)
        for key, (text, theirs) in PAPER_SETTINGS.items()
    ]
    found.append(_difference("repeats", {len(row.results) for row in trained}, PAPER_REPEATS))
    found.append(_difference("scored windows", {row.windows for row in rows}, PAPER_WINDOWS))
    sources = {log.dataset for log in run.record.logs}
    others = " and ".join(sorted(sources - {PAPER_DATASET}))
    place = "besides" if PAPER_DATASET in sources else "instead of"
    found.append(f"data {others} {place} Cityscapes" if others else "")
    told = ", ".join(filter(None, found))
    return f"Scaled from the paper's supplement: {told}." if told else "Trained as the paper's supplement says."


def _difference(text: str, ours: Iterable[object], theirs: float) -> str:
    values = sorted(set(ours), key=str)
    if not values or values == [theirs]:
        return ""
    shown = " or ".join("none" if value is None else f"{value:,}" for value in values)
    return f"{text} {shown} instead of {theirs:,}"
