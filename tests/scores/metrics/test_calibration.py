"""Calibration: against slow loops, and by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.calibration import calibration_curve

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.scores.metrics.calibration import Calibration
from semgrid_eval.scores.metrics.metric import Regions, ScoredWindows

SHAPE = (2, 3, 4)
GRIDS = arrays(np.uint8, SHAPE, elements=st.integers(0, 3))
COUNTS = arrays(np.int64, (256, 2), elements=st.integers(0, 9), fill=st.just(0))


def counted(target, prediction, certainty, mask, metric):
    """The sums (bins, 3) of all windows, outside the mask."""
    inputs = np.zeros((len(target), 1, 1, *target.shape[1:]), np.uint8)
    scored = ScoredWindows(target, prediction, certainty, mask, inputs, None, GridSpec())
    return metric.count(scored, Regions(np.where(mask, -1, 0), 1)).sum(axis=(0, 1))


def of_levels(counts, bins):
    """The metric and its sums for wrong and right cells of each level: (256, 2)."""
    metric, levels = Calibration(bins), np.repeat(np.arange(256), counts.sum(axis=1)).astype(np.uint8)
    right = np.concatenate([[0] * wrong + [1] * hits for wrong, hits in counts.tolist()]).astype(np.uint8)
    grids = (grid.reshape(1, 1, -1) for grid in (np.full_like(levels, 1), 2 - right, levels))
    return metric, counted(*grids, np.zeros((1, 1, len(levels)), bool), metric)


def reliability(counts, bins=10):
    metric, sums = of_levels(counts, bins)
    return metric.reliability(metric.ratios(sums))


def expected_calibration_error(counts, bins=10):
    metric, sums = of_levels(counts, bins)
    return metric.figures(metric.ratios(sums))[0]


@settings(max_examples=40)
@given(GRIDS, GRIDS, arrays(np.uint8, SHAPE), arrays(np.bool_, SHAPE))
def test_cells_outside_the_mask_that_are_predicted_known_count(target, prediction, certainty, mask):
    expected = np.zeros((5, 3), int)
    for at in np.ndindex(SHAPE):
        if not mask[at] and prediction[at] != UNKNOWN:
            level = int(certainty[at])
            expected[min(level * 5 // 255, 4)] += (1, target[at] == prediction[at], level)
    np.testing.assert_array_equal(counted(target, prediction, certainty, mask, Calibration(5)), expected)


def slow_bins(counts, bins):
    """Cells of each bin, one by one, as (certainty, right)."""
    found = [[] for _ in range(bins)]
    for level in range(256):
        number = next(b for b in range(bins) if b == bins - 1 or level * bins < 255 * (b + 1))
        for right in (0, 1):
            found[number] += [(level / 255, right)] * int(counts[level, right])
    return found


@settings(max_examples=40)
@given(COUNTS, st.integers(1, 20))
def test_bins_and_error_equal_going_through_the_cells(counts, bins):
    table, error, cells = reliability(counts, bins), 0.0, int(counts.sum())
    for number, found in enumerate(slow_bins(counts, bins)):
        assert table.cells[number] == len(found)
        if not found:
            assert math.isnan(table.certainty[number])
            assert math.isnan(table.right[number])
            continue
        certainty, right = (sum(values) / len(found) for values in zip(*found, strict=True))
        assert table.certainty[number] == pytest.approx(certainty)
        assert table.right[number] == pytest.approx(right)
        error += abs(certainty - right) * len(found) / cells
    assert expected_calibration_error(counts, bins) == (
        pytest.approx(error, abs=1e-12) if cells else pytest.approx(math.nan, nan_ok=True)
    )


def test_bins_equal_scikit_learns_where_no_certainty_lies_on_an_edge():
    counts = np.random.default_rng(2).integers(0, 5, (256, 2))
    certainty, right = np.repeat(np.indices(counts.shape).reshape(2, -1), counts.ravel(), axis=1)
    expected_right, expected_certainty = calibration_curve(right, certainty / 255, n_bins=7)
    table = reliability(counts, bins=7)
    np.testing.assert_allclose(table.right, expected_right)
    np.testing.assert_allclose(table.certainty, expected_certainty)
    gaps = np.abs(expected_right - expected_certainty)
    assert expected_calibration_error(counts, bins=7) == pytest.approx(gaps @ table.cells / counts.sum())


def test_who_is_always_certain_errs_as_often_as_wrong():
    counts = np.zeros((256, 2), np.int64)
    counts[255] = [1, 3]
    assert expected_calibration_error(counts) == 0.25
    counts[0] = [4, 0]  # never certain and never right: perfectly calibrated
    assert expected_calibration_error(counts) == 0.125


def test_who_is_as_often_right_as_it_is_certain_has_no_error():
    random = np.random.default_rng(4)
    shape = (40, 64, 64)
    certainty = random.integers(128, 256, shape).astype(np.uint8)
    prediction = random.integers(0, 3, shape).astype(np.uint8)  # a third of the cells unknown
    is_right = random.random(shape) < certainty / 255
    target = np.where(is_right, prediction, (prediction + random.integers(1, 3, shape)) % 3).astype(np.uint8)
    metric = Calibration()
    figures = metric.figures(metric.ratios(counted(target, prediction, certainty, np.zeros(shape, bool), metric)))
    error, precision, mean = figures.tolist()
    assert error < 0.005
    assert precision == pytest.approx(is_right[prediction != UNKNOWN].mean())
    assert mean == pytest.approx(certainty[prediction != UNKNOWN].mean() / 255)


def test_ratios_can_be_summed_like_counts():
    metric, sums = Calibration(), np.random.default_rng(1).integers(0, 99, (4, 10, 3))
    np.testing.assert_array_equal(metric.ratios(sums).sum(axis=0), metric.ratios(sums.sum(axis=0)))
