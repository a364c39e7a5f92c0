"""A run as data frames: the figures are those of what was counted, and windows add up to them."""

import numpy as np
import pandas as pd
import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.errors import InputError
from semgrid_eval.scores.metrics.table import METRICS
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.scores.results import read_run, result_folder
from semgrid_eval.scores.sums import read_sums
from semgrid_eval.scores.tidy import load_figures, tidy


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 2))
    return make_fake_run(tmp_path_factory.mktemp("tidy") / "run", rows=rows, recordings=3)


def test_every_figure_of_every_result_is_there_once(run):
    figures = load_figures(run)
    regions = sum(len(partition.regions) for partition in PARTITIONS.values())
    assert len(figures) == 3 * regions * sum(len(metric.columns) for metric in METRICS.values())
    assert not figures.duplicated(["row", "seed", "metric", "division", "region", "column"]).any()
    assert figures[figures.row == "BL-DC"].seed.isna().all()
    assert sorted(figures[figures.row == "ED-DC"].seed.unique()) == [0, 1]


def test_figures_are_those_of_the_pooled_counts(run):
    result = read_run(run).rows[1].results[1]
    counts = read_sums(result_folder(run, result), "iou", "all")[:, 0].sum(axis=0)
    car = CLASS_NAMES.index("car")
    figures = load_figures(run, metrics=["iou"], partitions=["all"]).set_index(["row", "seed", "column"])
    line = figures.loc[("ED-DC", 1, "car")]
    assert line.value == pytest.approx(counts[car, car] / (counts[car].sum() + counts[:, car].sum() - counts[car, car]))
    assert line.cells == counts[car].sum()
    assert line.windows == 6


def test_windows_add_up_to_the_figures(run):
    windows = pd.concat(tidy(run, metrics=["accuracy"], partitions=["origin"]))
    assert set(windows.recording) == {"town_000", "town_001", "town_002"}
    total = windows.fillna({"seed": -1}).groupby(["row", "seed", "region"])[["numerator", "denominator"]].sum()
    figures = load_figures(run, metrics=["accuracy"], partitions=["origin"]).fillna({"seed": -1})
    values = figures.set_index(["row", "seed", "region"]).value
    np.testing.assert_allclose((total.numerator / total.denominator).loc[values.index], values)


def test_frames_are_made_one_at_a_time(run):
    frames = tidy(run)
    first = next(frames)
    assert set(first.row) == {"BL-DC"}
    assert len(first) == 6 * 1 * len(METRICS["iou"].ratio_names)


def test_a_run_without_results_gives_an_empty_frame(tmp_path):
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "ED", failure="out of memory"),), recordings=1)
    assert load_figures(run).empty


def test_names_that_nothing_is_counted_by_are_named(run):
    with pytest.raises(InputError, match=r"metric: 'nope' is not one of iou, accuracy, calibration"):
        load_figures(run, metrics=["nope"])
    with pytest.raises(InputError, match=r"partition: 'nope' is not one of all, actors, distance, origin"):
        load_figures(run, partitions=["nope"])
