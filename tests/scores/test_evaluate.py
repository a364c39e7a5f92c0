"""Scoring a predictor: counts of all cells and of those near actors, against a loop over cells."""

import numpy as np
import pytest
import torch
from support.models import made, network
from support.recordings import random_recording

from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.errors import InputError
from semgrid_eval.models.encoder_decoder import EncoderDecoder
from semgrid_eval.models.model import Model
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.scores.evaluate import evaluate
from semgrid_eval.windows.data import select_windows, window_arrays
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, validation_windows


def windows_of(*recordings):
    data = stack_recordings(recordings, cell_m=0.5)
    plan = validation_windows(data.frame_counts, WindowConfig())
    return select_windows(data, plan.windows, sensors=["full"])


def slow_counts(kept, prediction, wanted):
    """Count cell by cell; `wanted` says of flags whether a cell counts."""
    counts = np.zeros((len(prediction), CLASS_COUNT, CLASS_COUNT), int)
    for n, row, column in np.ndindex(prediction.shape):
        at = n, row, column
        if not kept["mask"][at] and wanted(int(kept["actors"][at])):
            counts[n, kept["target"][at], prediction[at]] += 1
    return counts


@pytest.mark.parametrize("batch", [2, 16])
def test_regions_equal_counting_cell_by_cell(batch):
    windows = windows_of(*(random_recording(seed, truth=seed != 2) for seed in range(5)))
    scored = evaluate(made(RepeatNewest), windows, batch=batch)
    kept = window_arrays(windows)
    everywhere = slow_counts(kept, scored.prediction, lambda flags: True)
    np.testing.assert_array_equal(scored.sums["iou", "all"][:, 0], everywhere)
    moving, standing = np.moveaxis(scored.sums["iou", "actors"], 1, 0)
    np.testing.assert_array_equal(moving, slow_counts(kept, scored.prediction, lambda flags: flags in (2, 3)))
    np.testing.assert_array_equal(standing, slow_counts(kept, scored.prediction, lambda flags: flags == 1))
    assert [bool(counts.sum()) for counts in moving] == [True, True, False, True, True]  # number 2 has no truth


def test_class_and_certainty_are_those_of_the_largest_score_in_each_cell():
    scores = torch.rand(3, CLASS_COUNT, 16, 16, generator=torch.Generator().manual_seed(0))
    windows = windows_of(*(random_recording(seed) for seed in range(3)))

    class Fixed(Model):
        def predict(self, batch):
            return scores

    scored = evaluate(made(Fixed), windows)
    for n, row, column in np.ndindex(scored.prediction.shape):
        cell = scores[n, :, row, column].tolist()
        assert scored.prediction[n, row, column] == cell.index(max(cell))
        assert scored.certainty[n, row, column] == round(max(cell) * 255)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (torch.nan, "NaN or infinite"),
        (torch.inf, "NaN or infinite"),
        (-torch.inf, "NaN or infinite"),
        (1.2, "from 1 to 1.2, and scores go from 0 to 1"),
    ],
)
def test_no_answer_is_scored_that_is_not_scores_whoever_gives_it(value, message):
    class Fixed(Model):
        def predict(self, batch):
            scores = torch.ones(len(batch.target), CLASS_COUNT, 16, 16)
            scores[0, 3, 4, 5] = value
            return scores

    with pytest.raises(InputError, match=f"^Fixed: .*{message}"):
        evaluate(made(Fixed), windows_of(random_recording(0)))


def test_weights_that_are_all_nan_are_not_scored():
    net = network(EncoderDecoder, depth=2, features=4).eval()
    for parameter in net.parameters():
        parameter.data.fill_(torch.nan)
    with pytest.raises(InputError, match=r"^EncoderDecoder: gave scores that are NaN or infinite"):
        evaluate(net, windows_of(random_recording(0)))


def test_no_window_is_an_error():
    windows = windows_of(random_recording(0))
    empty = type(windows)(**{**vars(windows), "target_frames": windows.target_frames[:0]})
    with pytest.raises(InputError, match="no window to score"):
        evaluate(made(RepeatNewest), empty)
