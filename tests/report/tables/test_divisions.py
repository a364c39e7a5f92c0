"""The tables of all metrics: a metric and a partition that are added show up by themselves."""

import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.report.estimates.bootstrap import Resampling, score_all
from semgrid_eval.report.estimates.paces import divisions
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.scores import division_tables
from semgrid_eval.scores.metrics.metric import Column, Partition, divided
from semgrid_eval.scores.metrics.table import METRICS
from semgrid_eval.scores.regions.table import PARTITIONS


class Cars:
    """The share of the cells predicted to be cars that are cars."""

    name, title, shape = "cars", "Precision of cars", (2,)
    ratio_names = shown = ("precision",)
    columns = (Column("precision", "Cars"),)

    def count(self, scored, regions):
        right = (scored.target == 6).astype(int)
        return regions.tally(np.where(scored.prediction == 6, right, -1), 2)

    def ratios(self, sums):
        return np.stack([sums[..., 1], sums.sum(axis=-1)], axis=-1)[..., None, :]

    def figures(self, ratios):
        return divided(ratios[..., 0], ratios[..., 1])

    def cells(self, sums):
        return sums.sum(axis=-1, keepdims=True)


def sides(scored):
    middle = scored.target.shape[2] // 2
    return np.broadcast_to((np.arange(scored.target.shape[2]) >= middle).astype(int), scored.target.shape)


def tables_of(run):
    runs = load_runs([run])
    found = divisions(runs)
    return division_tables(score_all(runs[0].rows, found, Resampling(0, draws=20)), found)


def test_every_division_has_the_tables_that_it_shows(run):
    tables = {name: [table.name for table in found] for name, found in tables_of(run).items()}
    assert tables == {
        "all": ["all-accuracy", "all-accuracy-differences", "all-calibration", "all-calibration-differences"],
        "actors": ["actors", "actors-differences"],
        "distance": ["distance", "distance-differences"],
        "origin": ["origin-accuracy", "origin-accuracy-differences"],
        "paces": [],
        "warm_up": [],
    }


def test_a_metric_and_a_partition_that_are_added_have_tables(tmp_path, monkeypatch):
    monkeypatch.setitem(METRICS, "cars", Cars())
    monkeypatch.setitem(PARTITIONS, "sides", Partition("sides", ("left", "right"), "by side of the vehicle", sides))
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 2))
    tables = tables_of(make_fake_run(tmp_path / "run", rows=rows, recordings=4))
    (values, differences) = (table for table in tables["sides"] if table.name.startswith("sides-cars"))
    assert [note.partition(",")[0] for _, note in values.columns] == ["left", "right"]
    assert values.caption.startswith("Precision of cars by side of the vehicle, with 95% interval")
    assert len(differences.bodies) == 1
    assert [table.name for table in tables["all"]][-2:] == ["all-cars", "all-cars-differences"]


def test_a_result_that_lacks_a_metric_is_a_failure_of_its_row(tmp_path, monkeypatch):
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "BL"),), recordings=2)
    monkeypatch.setitem(METRICS, "cars", Cars())
    (row,) = load_runs([run])[0].rows
    assert row.results == ()
    assert "has no array cars.all" in row.failures[0]


@pytest.mark.parametrize("name", METRICS)
def test_metrics_say_what_their_figures_are(name):
    metric = METRICS[name]
    assert metric.name == name
    assert len({column.label for column in metric.columns}) == len(metric.columns)
    assert set(metric.shown) <= {column.name for column in metric.columns}
