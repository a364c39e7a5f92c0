"""Rivals find what the fast parts find, and are what they are called."""

import numpy as np
import pytest
from sklearn.metrics import confusion_matrix
from support.cameras import calibration

from semgrid_eval.bench.rivals import View, confusion_by_definition, grid_by_arrays
from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.rasterise import add_points, no_points, rasterise
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.scores.metrics.iou import confusion
from semgrid_eval.sensors.projection import Projection
from semgrid_eval.sensors.sensor import Points


@pytest.mark.parametrize("yaw_rad", [0.0, -0.7])
@pytest.mark.parametrize("size_px", [(64, 32), (40, 30)])
def test_plain_arrays_draw_the_same_grid(size_px, yaw_rad):
    random = np.random.default_rng(4)
    disparity = random.integers(0, 4000, (32, 64), np.uint16)
    label = random.integers(0, 34, (32, 64), np.uint8)
    view = View(calibration(fx_px=60.0, fy_px=61.0, u0_px=31.0, v0_px=15.0), size_px, DEFAULT_CLASSES.class_by_label())
    move, spec = SE2(1.5, -2.0, yaw_rad), GridSpec()
    seen, counts = Projection(*view).points(disparity, label), no_points(GridConfig())
    add_points(counts, Points("full", 0, seen.forward_m, seen.left_m, seen.class_id), move, spec)
    found = grid_by_arrays(disparity, label, view, move, spec)
    assert len(np.unique(found)) > 5
    np.testing.assert_array_equal(found, rasterise(counts, DEFAULT_CLASSES, "off"))


def test_cityscapes_way_counts_what_scikit_learn_does():
    random = np.random.default_rng(5)
    target, prediction = random.integers(0, CLASS_COUNT, (2, 3, 8, 9), dtype=np.uint8)
    left_out = random.random(target.shape) < 0.4
    found = confusion_by_definition(target, prediction, left_out)
    np.testing.assert_array_equal(found, confusion(target, prediction, left_out, CLASS_COUNT))
    labels = list(range(CLASS_COUNT))
    for window, kept in enumerate(~left_out):
        expected = confusion_matrix(target[window][kept], prediction[window][kept], labels=labels)
        np.testing.assert_array_equal(found[window], expected)
