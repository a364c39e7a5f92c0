"""Scores near moving and near standing actors apart, for results whose logs hold the truth about them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from semgrid_eval.report.estimates.bootstrap import Scores, score_rows
from semgrid_eval.report.rows.load import Result, Row
from semgrid_eval.report.tables.side_by_side import part_differences, part_frame, part_values
from semgrid_eval.report.tables.table import Table
from semgrid_eval.scores.results import REGIONS

SHOWN = ("vehicles", "person", "bicycle")
"""What the page shows; `regions.csv` has the classes of vehicles and the category of small dynamic ones, too."""
_KEPT = ("vehicles", "car", "large_vehicle", "small_dynamic", "person", "bicycle")


def score_regions(rows: Sequence[Row], seed: int) -> dict[str, Scores]:
    """Score rows near `moving` and near `standing` actors alone; a region that no result knows is left out."""
    found: dict[str, Scores] = {}
    for region in REGIONS:
        near = (_row_near(row, region) for row in rows)
        scores = score_rows([row for row in near if row.results], np.random.default_rng(seed))
        if scores:
            found[region] = scores
    return found


def region_tables(regions: Mapping[str, Scores]) -> dict[str, Table | None]:
    """Show scores by region side by side, and the paired differences of rows to their baselines alike."""
    values = "IoU of the cells near moving and near standing actors, with 95% interval. Best of each in bold."
    differences = (
        "Differences to the baseline near such actors, resampled together. Marked where the interval excludes zero."
    )
    return {
        "regions": part_values("regions", values, regions, SHOWN),
        "region_differences": part_differences("region-differences", differences, regions, SHOWN),
    }


def region_frame(regions: Mapping[str, Scores]) -> pd.DataFrame:
    """Return one line for each region, row and score, with the paired difference to the row's baseline."""
    return part_frame(regions, "region", _KEPT)


def _row_near(row: Row, region: str) -> Row:
    """Take a row's counts near such actors alone; results without the truth are left out."""
    return replace(row, results=tuple(_near(each, region) for each in row.results if region in each.regions))


def _near(result: Result, region: str) -> Result:
    """Keep the windows that have such actors, so that the number of windows is that of the evidence."""
    counts = result.regions[region]
    return result.of_windows(np.asarray(counts.sum(axis=(1, 2)) > 0), counts)
