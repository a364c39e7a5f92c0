"""What runs on grids without logs: the paper at its own scale, presets, scores of what is done, and what all cost."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from semgrid_eval.config import parse_config
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.models.network import TrainingConfig
from semgrid_eval.report.claims.claims import in_paper
from semgrid_eval.report.estimates.bootstrap import Resampling, RowScores, score_everywhere
from semgrid_eval.report.estimates.division import EVERYWHERE
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Row as ReadRow
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.runs.matrix import Matrix, load_matrix
from semgrid_eval.runs.row import Row, plan_units
from semgrid_eval.scores.metrics.table import IOU

ORDER = (
    *("BL-DC", "BL-Fuse", "ED-DC", "RN-DC", "ED-SL5", "ED-NT", "ED-Sp2", "ED-PH3", "ED-Sp1", "ED-SL3", "ED-PH1"),
    *(
        "ED-SL4",
        "ED-PH2",
        "BL-NT",
        "BL-Sp1",
        "BL-Sp2",
        "BL-PH1",
        "BL-PH2",
        "BL-PH3",
        "BL-Fuse-SL5",
        "BL-Flow",
        "BL-Table",
    ),
)
"""Rows from the one that decides most to the one that decides least; `ED-SL2` is `ED-DC` under another name."""
AGAINST = ("BL-Fuse", "BL-DC")
"""Baselines that every row is measured against."""
GOAL_H = 4.0
REPEATS = 20
_SMOKE = {"epochs": 1, "updates_per_epoch": 1, "batch": 2}


def paper_matrix(*, smoke: bool = False) -> Matrix:
    """Return `paper` with one repeat, and the baselines of `paper-cpu`, without its second target.

    `smoke` keeps the first three rows, the network as small and trained as
    little as can be.
    """
    paper, scaled = load_matrix("paper"), load_matrix("paper-cpu")
    rows = {row.name: row for row in (*scaled.rows, *paper.rows) if row in paper.rows or row.facts.baseline}
    names = [name for name in ORDER if name in rows][: 3 if smoke else None]
    size = _SMOKE if smoke else TrainingConfig().model_dump(include=set(_SMOKE))
    once = (rows[name].model_copy(update={"repeats": 1}) for name in names)
    sized = tuple(_sized(row, size, smoke=smoke) for row in once)
    return Matrix(title=paper.title, seed=paper.seed, rows=sized)


def matrix_of_grids(preset: str, *, smoke: bool = False) -> Matrix:
    """Return the rows of a preset for which grids alone suffice, of the default configuration, without second targets.

    `smoke` keeps the first row of each model, as small and trained as little as can be.
    """
    matrix = load_matrix(preset)
    rows = [row for row in matrix.rows if row.grid == GridConfig() and row.asked is None]
    if smoke:
        rows = list({row.model: row for row in reversed(rows)}.values())
    size = _SMOKE if smoke else {}
    return Matrix(title=matrix.title, seed=matrix.seed, rows=tuple(_sized(row, size, smoke=smoke) for row in rows))


def _sized(row: Row, size: Mapping[str, int], *, smoke: bool) -> Row:
    """Change how long a network is trained; grids that are carried along have no second target."""
    settings = dict(row.settings)
    if "training" in settings:
        settings["training"] = settings["training"] | size
        settings |= {"features": 2} if smoke and "features" in settings else {}
    return parse_config(Row, row.model_dump(mode="json") | {"settings": settings, "second_target": None})


def scores_of(folder: Path, reference: Path) -> dict[str, dict[str, object]]:
    """Return scores of the rows that a run has finished, with intervals over recordings, and paired differences.

    `reference` is the folder of a report, whose scores are put beside them.
    """
    (run,) = load_runs([folder])
    kept = kept_scores(reference)
    scores = score_everywhere(run.rows, IOU, Resampling())
    rows = {name: _row(entry, scores, kept.get(name)) for name, entry in scores.items()}
    failed = {row.name: row.failures[0] for row in run.rows if row.failures and not row.results}
    return rows | {name: {"failure": reason} for name, reason in failed.items()}


def _row(entry: RowScores, scores: Mapping[str, RowScores], kept: Mapping[str, float] | None) -> dict[str, object]:
    record, history = entry.results[0].record, entry.results[0].history
    others = [scores[name] for name in AGAINST if name in scores and name != entry.row.name]
    return {
        "what": entry.row.record.label,
        "train_seconds": record.train_seconds,
        "updates": None if history is None else int(history["updates"].iloc[-1]),
        "loss": None if history is None else float(history["loss"].iloc[-1]),
        "validation_loss": None if history is None else float(history["validation_loss"].iloc[-1]),
        "parameters": record.parameters,
        "windows": entry.windows,
        "scores": {column: _plain(entry.estimate(column)) for column in IOU.category_columns},
        "scores_of_reference": kept,
        "minus": {
            other.row.name: {column: _plain(entry.minus(other, column)) for column in IOU.category_columns}
            for other in others
            if other.row.targets == entry.row.targets
        },
    }


def _plain(estimate: Estimate) -> list[float]:
    """Return value, low and high, rounded."""
    return [round(each, 4) for each in (estimate.value, estimate.low, estimate.high)]


def kept_scores(report: Path) -> dict[str, dict[str, float]]:
    """Read the IoU of the categories from a report's summary, by the names of the rows."""
    table = pd.read_csv(report / "summary.csv")
    table = table[(table["metric"] == IOU.name) & (table["division"] == EVERYWHERE.name) & (table["region"] == "all")]
    table = table[table["column"].isin(IOU.category_columns)]
    return {
        str(row): dict(zip(each["column"], each["value"].round(4), strict=True)) for row, each in table.groupby("row")
    }


def price_of_paper(run: Path) -> dict[str, object]:
    """Estimate the hours of the paper's own rows on one GPU from a run in a fresh folder, scoring included.

    Rows that the paper's table lacks (those of the residual network) are neither counted nor priced: the run's time is
    divided as the seconds of its trainings are.
    """
    (found,) = load_runs([run])
    seconds = {row.name: each for row in found.rows if (each := _train_seconds(row)) is not None}
    priced = [each for name, each in seconds.items() if in_paper(name)]
    if not sum(priced):
        return {}
    each_s = found.record.seconds * sum(priced) / sum(seconds.values()) / len(priced)
    trainings = _trainings_of_paper()
    return {
        "what": "an estimate: the run's time for each training of the paper's own rows, times all of these",
        "trainings": trainings,
        "seconds_each": round(each_s, 1),
        "hours": round(trainings * each_s / 3600, 2),
        "goal_hours": GOAL_H,
    }


def _trainings_of_paper() -> int:
    """Count the trainings of the rows in the paper's table; the preset `paper` has more rows."""
    rows = [row.model_copy(update={"repeats": REPEATS}) for row in load_matrix("paper").rows if in_paper(row.name)]
    return sum(unit.row.facts.learns for unit in plan_units(rows, 0).values())


def _train_seconds(row: ReadRow) -> float | None:
    return row.results[0].record.train_seconds if row.results else None
