"""Augmentation: each kind by hand on small grids, M that stays what it means, and what chance decides."""

import math
from dataclasses import replace

import pytest
import torch
from support.recordings import random_recording

from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.augment import AugmentConfig, augment, flipped, misaligned, rotated
from semgrid_eval.models.network import TrainingConfig
from semgrid_eval.windows.data import WindowBatch, select_windows
from semgrid_eval.windows.grids import covered_without_truth, shift_grids, stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

ALL = AugmentConfig(flip=0.5, rotate_deg=10.0, misalign_cells=2)
FIELDS = ("past", "shift_cells", "lead_s", "target", "mask")


def batch_of(past, target, shifts=((0, 0),)):
    """One window of one sensor; the inputs (T, H, W) lie in the target's place."""
    past, target = torch.tensor(past, dtype=torch.uint8)[None, None], torch.tensor(target, dtype=torch.uint8)[None]
    inputs = past.shape[2]
    shift_cells = torch.tensor(shifts).expand(inputs, 2)[None]
    mask = covered_without_truth(past, target)
    return WindowBatch(past, ("full",), shift_cells, torch.zeros(1, inputs), target, mask)


def windows(*, translate=True):
    data = stack_recordings([random_recording(0), random_recording(1)], cell_m=0.5)
    plan = training_windows(data.frame_counts, WindowConfig(step_frames=2))
    return select_windows(data, plan.windows, sensors=["full"], translate=translate)


def augmented(batch, config, seed=0, *, translate=True):
    return augment(batch, config, torch.Generator().manual_seed(seed), translate=translate)


def same(a, b):
    return all(torch.equal(getattr(a, name), getattr(b, name)) for name in FIELDS)


def test_a_mirrored_window_is_mirrored_everywhere_and_its_shift_goes_to_the_other_side():
    batch = batch_of([[[1, 2, 0], [3, 0, 0]]], [[0, 5, 6], [7, 0, 0]], shifts=((2, -1),))
    turned = augmented(batch, AugmentConfig(flip=1.0))
    assert turned.past[0, 0, 0].tolist() == [[0, 2, 1], [0, 0, 3]]
    assert turned.target[0].tolist() == [[6, 5, 0], [0, 0, 7]]
    assert turned.mask[0].tolist() == [[False, False, True], [False, False, False]]
    assert turned.shift_cells.tolist() == [[[2, 1]]]


def test_only_the_chosen_windows_are_mirrored_and_twice_is_never():
    batch = windows().batch(slice(0, 4))
    chosen = torch.tensor([True, False, False, True])
    once = flipped(batch, chosen)
    for window, is_mirrored in enumerate(chosen.tolist()):
        assert torch.equal(once.past[window], batch.past[window].flip(-1)) == is_mirrored
        assert torch.equal(once.past[window], batch.past[window]) != is_mirrored
    assert same(flipped(once, chosen), batch)


def test_a_quarter_turn_to_the_left_is_about_the_middle_of_the_lower_edge():
    # Ahead of the vehicle, which stands between the two cells of the lowest row, comes to lie to its left.
    grid = [[1, 0, 0, 0], [2, 0, 0, 0], [0, 3, 4, 0], [0, 5, 6, 0]]
    batch = batch_of([grid], grid, shifts=((1, 0),))
    turned = rotated(batch, torch.tensor([math.pi / 2], dtype=torch.float64))
    expected = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [4, 6, 0, 0]]
    assert turned.target[0].tolist() == expected
    assert turned.past[0, 0, 0].tolist() == expected
    assert turned.shift_cells.tolist() == [[[0, 1]]]


def test_a_small_turn_moves_far_cells_aside_and_leaves_near_ones():
    target = torch.zeros(1, 64, 64, dtype=torch.uint8)
    target[0, :, 31:33] = 4  # a road straight ahead
    batch = batch_of(target.tolist(), target[0].tolist())
    turned = rotated(batch, torch.tensor([math.radians(5.0)], dtype=torch.float64)).target[0]
    middle = (turned * torch.arange(64)).sum(dim=1) / turned.sum(dim=1)
    aside = 31.5 - middle  # columns to the left
    ahead = 63.5 - torch.arange(64)
    assert torch.allclose(aside, ahead * math.tan(math.radians(5.0)), atol=0.6)
    assert aside[0] == pytest.approx(5.5, abs=0.6)


def test_no_turn_and_no_move_change_nothing():
    batch = windows().batch(slice(0, 3))
    assert same(rotated(batch, torch.zeros(3, dtype=torch.float64)), batch)
    assert same(misaligned(batch, torch.zeros(3, 2, 2, dtype=torch.int64)), batch)


def test_each_input_is_moved_by_its_own_cells_and_the_target_is_not():
    grid = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    batch = batch_of([grid, grid], [[1, 0, 0], [0, 0, 0], [0, 0, 0]])
    moved = misaligned(batch, torch.tensor([[[1, 0], [-1, -2]]]))
    assert moved.past[0, 0, 0].tolist() == [[0, 0, 0], [1, 2, 3], [4, 5, 6]]
    assert moved.past[0, 0, 1].tolist() == [[6, 0, 0], [9, 0, 0], [0, 0, 0]]
    assert torch.equal(moved.target, batch.target)
    assert torch.equal(moved.shift_cells, batch.shift_cells)


@pytest.mark.parametrize("translate", [True, False])
@pytest.mark.parametrize(
    "config",
    [AugmentConfig(flip=1.0), AugmentConfig(rotate_deg=20.0), AugmentConfig(misalign_cells=3), ALL],
)
def test_the_mask_is_what_an_aligned_input_knows_and_the_target_does_not(config, translate):
    batch = augmented(windows(translate=translate).batch(slice(None)), config, translate=translate)
    aligned = batch.past if translate else shift_grids(batch.past, batch.shift_cells[:, None])
    known = torch.zeros_like(batch.mask)
    for sensor in range(aligned.shape[1]):
        for step in range(aligned.shape[2]):
            known |= aligned[:, sensor, step] != 0
    assert torch.equal(batch.mask, known & (batch.target == 0))
    assert 0 < batch.mask.float().mean() < 1


def test_inputs_that_are_not_moved_yet_come_to_the_same_place():
    moved, still = (windows(translate=translate).batch(slice(None)) for translate in (True, False))
    assert (moved.shift_cells != 0).any()
    chosen = torch.arange(len(moved.target)) % 2 == 0
    assert torch.equal(
        shift_grids(flipped(still, chosen).past, flipped(still, chosen).shift_cells[:, None]),
        flipped(moved, chosen).past,
    )


def test_nothing_is_done_and_drawn_by_default():
    batch, generator = windows().batch(slice(0, 2)), torch.Generator().manual_seed(3)
    before = generator.get_state()
    assert augment(batch, TrainingConfig().augment, generator, translate=True) is batch
    assert torch.equal(generator.get_state(), before)


def test_a_seed_decides_everything_that_is_drawn():
    batch = windows().batch(slice(None))
    assert same(augmented(batch, ALL, seed=1), augmented(batch, ALL, seed=1))
    assert not same(augmented(batch, ALL, seed=1), augmented(batch, ALL, seed=2))
    assert not same(augmented(batch, ALL), batch)


def test_the_batch_that_comes_in_stays_as_it_is():
    batch = windows().batch(slice(None))
    copy = replace(batch, **{name: getattr(batch, name).clone() for name in FIELDS})
    augmented(batch, ALL)
    assert same(batch, copy)


def test_strengths_are_drawn_up_to_what_is_asked_for():
    count, far = 4000, torch.full((1, 1, 1, 9, 9), 0, dtype=torch.uint8)
    far[..., 4, 4] = 5
    past = far.expand(count, 1, 1, 9, 9)
    batch = WindowBatch(past, ("full",), torch.zeros(count, 1, 2).long(), torch.zeros(count, 1), past[:, 0, 0], None)
    moved = augmented(batch, AugmentConfig(misalign_cells=2)).past[:, 0, 0].flatten(1).long().argmax(dim=1)
    shifts = torch.stack([moved // 9 - 4, moved % 9 - 4], dim=1)
    for axis in range(2):
        shares = torch.bincount(shifts[:, axis] + 2, minlength=5) / count
        assert shares.tolist() == pytest.approx([0.2] * 5, abs=0.04)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ({"flip": 1.5}, r"augment.flip.*not 1\.5"),
        ({"rotate_deg": -1.0}, r"augment\.rotate_deg"),
        ({"misalign_cells": 0.5}, r"augment\.misalign_cells"),
        ({"scale": 2}, "unknown key; allowed here: flip, misalign_cells, rotate_deg"),
    ],
)
def test_impossible_wishes_are_refused_by_name(value, message):
    with pytest.raises(ConfigError, match=message):
        parse_config(TrainingConfig, {"augment": value})
