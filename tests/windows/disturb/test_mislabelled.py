from dataclasses import replace

import numpy as np
import pytest
from support.disturbed import SPEC, batch_of, numbered, windows_of
from support.own_classes import class_set
from support.recordings import random_recording

from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.windows.disturb.mislabelled import patches

BIG = GridSpec(rows=64, columns=64, cell_m=1.0, agent_row=64, agent_column=32)


def test_every_known_cell_of_a_patch_has_another_known_class_and_the_unknown_stay_unknown():
    windows = windows_of([random_recording(4, size=64)], [(0, (0, 5), 10)], spec=BIG, translate=False)
    plain = batch_of(windows, spec=BIG).past.numpy()
    found = batch_of(windows, spec=BIG, kind="mislabelled", strength=1.0, patch_m=4.0).past.numpy()
    np.testing.assert_array_equal(found == 0, plain == 0)
    assert (found[plain > 0] != plain[plain > 0]).all()
    assert found.max() == 9


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_a_share_of_the_cells_is_changed(share):
    windows = windows_of(
        [random_recording(i, size=64) for i in range(20)], [(i, (0, 5), 10) for i in range(20)], spec=BIG
    )
    plain = batch_of(windows, spec=BIG).past.numpy()
    found = batch_of(windows, spec=BIG, kind="mislabelled", strength=share, patch_m=2.0).past.numpy()
    assert (found != plain)[plain > 0].mean() == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize("known", [1, 2])
def test_known_cells_stay_known_whatever_the_number_of_classes(known):
    recording = random_recording(4, size=64)
    recording.grids[:] %= known + 1
    windows = windows_of([recording], [(0, (0, 5), 10)], spec=BIG, translate=False)
    labels = ({"name": f"c{i}", "category": "all", "labels": [i]} for i in range(1, known + 1))
    windows = replace(windows, data=replace(windows.data, classes=class_set(*labels, categories=[{"name": "all"}])))
    plain = batch_of(windows, spec=BIG).past.numpy()
    found = batch_of(windows, spec=BIG, kind="mislabelled", strength=1.0, patch_m=4.0).past.numpy()
    np.testing.assert_array_equal(found == 0, plain == 0)
    assert found.max() == known
    assert (found[plain > 0] != plain[plain > 0]).all() == (known > 1), "one class has no other to move on to"


def test_patches_are_squares_of_one_change_on_a_lattice():
    steps = patches(np.random.default_rng(3), 0.5, 3, (13, 10), 9)
    assert steps.shape == (13, 10)
    edges = [np.flatnonzero(np.diff(steps.astype(int), axis=axis).any(axis=1 - axis)) + 1 for axis in (0, 1)]
    for found in edges:
        assert len({edge % 3 for edge in found.tolist()}) == 1, "all edges are a multiple of the side apart"
    assert 1 <= steps[steps > 0].min() <= steps.max() <= 8


def test_inputs_of_one_time_have_the_same_patches_for_all_sensors_and_others_at_other_times():
    recording = numbered(4, sensors=("full", "rear"))
    recording.grids[:] = 1
    windows = windows_of([recording], [(0, (0, 1), 2)], sensors=("full", "rear"))
    drawn = {"kind": "mislabelled", "strength": 0.5, "patch_m": 2.0}
    past = batch_of(windows, **drawn).past[0].numpy()
    np.testing.assert_array_equal(past[0], past[1])
    assert (past[0, 0] != past[0, 1]).any()
    np.testing.assert_array_equal(batch_of(windows, **drawn).past[0].numpy(), past)
    assert (batch_of(windows, **drawn, seed=1).past[0].numpy() != past).any()


def test_a_patch_is_at_least_one_cell():
    recording = numbered(3)
    recording.grids[:] = 1
    found = batch_of(windows_of([recording], [(0, (0, 1), 2)]), kind="mislabelled", strength=0.5, patch_m=0.1)
    assert 0.3 < (found.past.numpy() != 1).mean() < 0.7
    assert SPEC.cell_m > 0.1
