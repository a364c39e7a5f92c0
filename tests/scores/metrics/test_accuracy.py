"""Accuracy against a loop over cells."""

import numpy as np
import pytest
from support.windows import random_windows

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.scores.metrics.accuracy import Accuracy
from semgrid_eval.scores.metrics.metric import Regions


def test_the_share_of_right_cells_is_that_of_those_the_target_knows():
    scored, metric = random_windows(3, classes=3), Accuracy()
    sums = metric.count(scored, Regions(np.where(scored.left_out, -1, 0), 1))
    right = known = 0
    for at in np.ndindex(scored.target.shape):
        if not scored.left_out[at] and scored.target[at] != UNKNOWN:
            known += 1
            right += scored.target[at] == scored.prediction[at]
    total = sums.sum(axis=(0, 1))
    assert total.tolist() == [known - right, right]
    assert metric.figures(metric.ratios(total)).tolist() == [pytest.approx(right / known)]
    assert metric.cells(total).tolist() == [known]


def test_without_a_known_cell_there_is_no_share():
    metric = Accuracy()
    assert np.isnan(metric.figures(metric.ratios(np.zeros(2, np.int64)))).all()
