from fractions import Fraction
from math import floor

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn.functional import interpolate

from semgrid_eval.segmentation.pixels import best_class, network_input

SIDES = st.integers(1, 12)


def random_scores(seed, classes, height, width):
    return np.random.default_rng(seed).normal(size=(classes, height, width)).astype(np.float32)


def test_image_is_normalised_channel_by_channel():
    picture = np.array([[[0, 51, 255], [255, 102, 0]]], np.uint8)
    tensor = network_input(picture, (2, 1), mean=(0.5, 0.0, 0.0), std=(0.5, 0.2, 1.0))
    assert tensor.dtype == np.float32
    assert tensor == pytest.approx(np.array([[[[-1, 1]], [[1, 2]], [[1, 0]]]]), abs=1e-6)


def test_image_is_scaled_before_it_is_normalised():
    picture = np.zeros((2, 4, 3), np.uint8)
    picture[:, 2:] = 200
    tensor = network_input(picture, (2, 1), mean=(0.0,) * 3, std=(1 / 255,) * 3)
    assert tensor == pytest.approx(np.array([[[[0, 200]]] * 3]).reshape(1, 3, 1, 2), abs=1e-4)


@given(st.integers(0, 99), st.integers(2, 5), SIDES, SIDES, SIDES, SIDES)
def test_smooth_classes_are_those_of_scores_scaled_by_torch(seed, classes, height, width, new_height, new_width):
    scores = random_scores(seed, classes, height, width)
    found = best_class(scores, (new_width, new_height), smooth=True)
    scaled = interpolate(torch.from_numpy(scores)[None], (new_height, new_width), mode="bilinear")[0].numpy()
    highest = scaled.max(axis=0)
    chosen = np.take_along_axis(scaled, found[None].astype(np.int64), axis=0)[0]
    assert found.shape == (new_height, new_width)
    assert chosen == pytest.approx(highest, abs=1e-5)  # equal but for the order of rounding


@given(st.integers(0, 99), SIDES, SIDES, SIDES, SIDES)
def test_nearest_classes_are_those_of_the_pixel_whose_area_holds_the_centre(seed, height, width, new_height, new_width):
    scores = random_scores(seed, 4, height, width)
    rows = [floor(Fraction(2 * row + 1, 2) / new_height * height) for row in range(new_height)]
    columns = [floor(Fraction(2 * column + 1, 2) / new_width * width) for column in range(new_width)]
    ids = scores.argmax(axis=0).astype(np.uint8)
    assert np.array_equal(best_class(scores, (new_width, new_height), smooth=False), ids[np.ix_(rows, columns)])


@given(st.integers(0, 99), SIDES, SIDES)
def test_at_the_size_of_the_scores_classes_are_their_argmax(seed, height, width):
    scores = np.random.default_rng(seed).integers(0, 3, (6, height, width)).astype(np.float16)  # ties abound
    for smooth in (True, False):
        assert np.array_equal(best_class(scores, (width, height), smooth=smooth), scores.argmax(axis=0))


def test_scores_are_left_as_they_are():
    scores = random_scores(1, 3, 4, 4)
    before = scores.copy()
    best_class(scores, (4, 4), smooth=True)
    assert np.array_equal(scores, before)
