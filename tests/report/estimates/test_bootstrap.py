from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.fake_run import make_fake_run

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, UNKNOWN, category_members
from semgrid_eval.report.estimates.bootstrap import (
    COLUMNS,
    Estimate,
    RowScores,
    counts_by_recording,
    recording_weights,
    score_columns,
    score_rows,
)
from semgrid_eval.report.rows.load import load_runs

COUNTS = arrays(np.int64, (CLASS_COUNT, CLASS_COUNT), elements=st.integers(0, 50))


def _slow_iou(counts, ids):
    hits = sum(int(counts[i, j]) for i in ids for j in ids)
    inside = sum(int(counts[i, j]) for i in range(CLASS_COUNT) for j in range(CLASS_COUNT) if i in ids or j in ids)
    return hits / inside if inside else float("nan")


@given(COUNTS)
def test_columns_are_class_ious_means_of_categories_and_merged_categories(counts):
    got = dict(zip(COLUMNS, score_columns(counts), strict=True))
    classes = [_slow_iou(counts, {i}) for i in range(CLASS_COUNT)]
    known = [v for i, v in enumerate(classes) if i != UNKNOWN and v == v]
    np.testing.assert_allclose([got[name] for name in CLASS_NAMES], classes)
    np.testing.assert_allclose(got["mean_known"], np.mean(known) if known else np.nan)
    for name, ids in category_members().items():
        present = [classes[i] for i in ids if classes[i] == classes[i]]
        np.testing.assert_allclose(got[name], np.mean(present) if present else np.nan)
        np.testing.assert_allclose(got[f"merged_{name}"], _slow_iou(counts, set(ids)))
    static = set(category_members()["static"]) - {UNKNOWN}
    np.testing.assert_allclose(got["merged_static_known"], _slow_iou(counts, static))


def test_counts_are_summed_by_recording(run):
    row = load_runs([run])[0].rows[0]
    result = row.results[0]
    names = sorted({window.recording for window in result.record.windows})
    got = counts_by_recording(result, {name: i for i, name in enumerate(names)})
    for i, name in enumerate(names):
        mine = [c for c, window in zip(result.counts, result.record.windows, strict=True) if window.recording == name]
        np.testing.assert_array_equal(got[i], sum(mine))
    assert got.sum() == result.counts.sum()


def test_each_resample_has_as_many_recordings_as_there_are():
    weights = recording_weights(7, np.random.default_rng(1), draws=50)
    assert weights.shape == (50, 7)
    assert (weights.sum(axis=1) == 7).all()


def test_a_resample_scores_like_the_recordings_copied_out(run):
    """The draws agree with a twin that copies whole recordings and pools their counts."""
    row = load_runs([run])[0].rows[0]
    got = score_rows([row], np.random.default_rng(3), draws=5)[row.name]
    index = {name: i for i, name in enumerate(sorted({w.recording for w in row.results[0].record.windows}))}
    for weights, draw in zip(recording_weights(len(index), np.random.default_rng(3), draws=5), got.draws, strict=True):
        pairs = zip(row.results[0].counts, row.results[0].record.windows, strict=True)
        copies = [c.astype(np.int64) for c, w in pairs for _ in range(weights[index[w.recording]])]
        np.testing.assert_allclose(draw, score_columns(np.sum(copies, axis=0)))


def test_value_is_the_mean_over_seeds_of_pooled_scores(run):
    row = next(row for row in load_runs([run])[0].rows if len(row.results) == 3)
    got = score_rows([row], np.random.default_rng(0), draws=10)[row.name]
    cars = [_slow_iou(result.counts.sum(axis=0), {CLASS_NAMES.index("car")}) for result in row.results]
    assert got.mean["car"] == pytest.approx(np.mean(cars))
    assert got.by_seed[:, COLUMNS.index("car")] == pytest.approx(cars)


def test_a_row_does_not_differ_from_itself(run):
    rows = load_runs([run])[0].rows[:1]
    entry = score_rows(rows, np.random.default_rng(0))[rows[0].name]
    assert entry.minus(entry, "road") == Estimate(0.0, 0.0, 0.0)
    assert not entry.minus(entry, "road").sure


def test_rows_that_share_their_trainings_do_not_differ(run):
    row = next(row for row in load_runs([run])[0].rows if len(row.results) == 3)
    twin = replace(row, name="twin")
    scores = score_rows([row, twin], np.random.default_rng(0))
    assert scores["twin"].minus(scores[row.name], "road") == Estimate(0.0, 0.0, 0.0)


def test_stretches_of_one_log_are_resampled_together(run):
    row = load_runs([run])[0].rows[0]
    one = replace(row, results=tuple(map(_as_stretches, row.results)))
    entry = score_rows([one], np.random.default_rng(0))[row.name]
    assert np.isnan(entry.estimate("road").low)  # one log gives no interval, however many stretches it was cut into


def _as_stretches(result):
    windows = tuple(
        window.model_copy(update={"recording": f"drive#{number}"})
        for number, window in enumerate(result.record.windows)
    )
    return replace(result, record=result.record.model_copy(update={"windows": windows}))


def test_pairing_makes_differences_surer_than_the_rows_alone(run):
    rows = load_runs([run])[0].rows
    scores = score_rows(rows, np.random.default_rng(0))
    first, second = scores["BL-DC"], scores["BL-Fuse"]
    difference = first.minus(second, "static")
    widths = [e.high - e.low for e in (first.estimate("static"), second.estimate("static"))]
    assert difference.high - difference.low < sum(widths)
    assert difference.low <= difference.value <= difference.high


def test_one_recording_gives_no_interval(tmp_path):
    rows = load_runs([make_fake_run(tmp_path / "run", recordings=1)])[0].rows
    entry = score_rows(rows, np.random.default_rng(0))["BL-DC"]
    assert np.isnan(entry.estimate("road").low)
    assert not entry.estimate("road").sure


def test_an_interval_is_the_middle_of_the_draws(run):
    row = load_runs([run])[0].rows[0]
    draws = np.full((1001, len(COLUMNS)), np.nan)
    draws[:, COLUMNS.index("road")] = np.linspace(0, 1, 1001)
    entry = RowScores(row, np.full((1, len(COLUMNS)), 0.5), draws)
    assert entry.estimate("road") == Estimate(0.5, pytest.approx(0.025), pytest.approx(0.975))
    assert np.isnan(entry.estimate("car").low)
