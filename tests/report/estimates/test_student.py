"""Intervals of few recordings are as long as Student's distribution asks."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from support.fake_run import FakeRow, counted_row, make_fake_run, with_counts
from support.scoring import score_rows

from semgrid_eval.report.estimates.bootstrap import Resampling, recording_weights, score_regions
from semgrid_eval.report.estimates.division import EVERYWHERE
from semgrid_eval.report.estimates.intervals import Estimate, intervals_of, stretched
from semgrid_eval.report.estimates.student import stretch, student_quantile
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import IOU


@pytest.mark.parametrize("level", [0.5, 0.95, 0.99])
@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 5, 6, 9, 30, 119, 1000])
def test_quantiles_are_students(freedom, level):
    assert student_quantile(freedom, level) == pytest.approx(stats.t.ppf((1 + level) / 2, freedom), rel=1e-9)


def test_many_recordings_hardly_lengthen_an_interval_and_few_do():
    assert [round(stretch(units, 0.95), 3) for units in (2, 3, 5, 10, 120)] == [9.168, 2.689, 1.584, 1.217, 1.015]


@pytest.mark.parametrize(("recordings", "most"), [(3, 0.035), (5, 0.035), (10, 0.035)])
def test_the_truth_is_missed_on_one_side_about_as_often_as_said(recordings, most):
    """Means of normal values, whose truth is 0; resamples alone lie below it in 13, 8 and 5 of 100 cases."""
    generator = np.random.default_rng(recordings)
    values = generator.normal(size=(1500, recordings))
    draws = [recording_weights(recordings, generator, draws=300) @ each / recordings for each in values]
    found = intervals_of(values.mean(axis=1), stretched(np.transpose(draws), np.full(len(values), recordings)))
    assert 0.01 < sum(each.high < 0 for each in found) / len(found) < most


def test_stretched_draws_keep_their_middle_and_their_lean():
    draws = np.array([[0.0], [1.0], [2.0], [2.5], [np.nan]])
    found = stretched(draws, np.array([10]))
    assert np.nanmedian(found) == 1.5
    np.testing.assert_allclose(found - 1.5, stretch(10, 0.95) * (draws - 1.5))


def test_an_interval_stays_within_what_values_can_be():
    rows = counted_row("one", {"car": [2, 90, 99]}), counted_row("other", {"car": [99, 40, 2]})
    scores = score_rows(rows, 0)
    alone, difference = scores["one"].estimate("car"), scores["one"].minus(scores["other"], "car")
    assert (alone.low, alone.high) == (0.0, 1.0)
    assert (difference.low, difference.high) == (-1.0, 1.0)


def test_a_class_that_one_recording_alone_has_gets_no_interval():
    """Four recordings have a car; one has a person, whom another is mistaken for in a second one."""
    row = counted_row("one", {"car": [50, 60, 70, 80]})
    counts = row.results[0].counts.copy()
    counts[0, 7, 7], counts[1, 3, 7] = 30, 20
    row = replace(row, results=(with_counts(row.results[0], counts),))
    entry = score_rows([row], 0)["one"]
    cells = {name: entry.cells[name] > 0 for name in IOU.labels}
    person = next(
        name for name in IOU.labels if cells[name] and name not in ("car", "vehicles") and entry.cells[name] == 30
    )
    assert np.isfinite(entry.estimate(person).value)
    assert np.isnan(entry.estimate(person).low)
    assert np.isfinite([entry.estimate(name).low for name in ("car", "mean_known")]).all()


def test_equal_ratios_in_several_recordings_are_an_interval_of_no_length():
    row = counted_row("one", {"car": [50, 50, 50]})
    assert score_rows([row], 0)["one"].estimate("car") == Estimate(0.5, 0.5, 0.5)


def test_a_run_of_one_recording_has_no_interval_beside_another(tmp_path):
    rows = (FakeRow("DC", "BL"),)
    folders = [make_fake_run(tmp_path / f"{many}", rows=rows, recordings=many, windows=1) for many in (1, 4)]
    one, four = (run.rows[0] for run in load_runs(folders))
    scores = score_rows([one, four], 0)
    assert np.isnan(scores[one.name].estimate("road").low)
    assert np.isfinite(scores[four.name].estimate("road").low)


def test_groups_are_what_is_counted_where_they_are_resampled():
    row = counted_row("one", {"car": [50, 60, 70, 80]})
    windows = row.results[0].record.windows
    for towns, has in ((("a", "a", "a", "a"), False), (("a", "a", "b", "b"), True)):
        of_towns = replace(row, groups={window.log: town for window, town in zip(windows, towns, strict=True)})
        entry = score_regions([of_towns], IOU, EVERYWHERE, Resampling(0, level="groups"))["all"]["one"]
        assert np.isfinite(entry.estimate("car").low) == has
