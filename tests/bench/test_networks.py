"""The textbook's training is a fair twin: it sees what ours sees."""

import torch

from semgrid_eval.bench.networks import prepare_window, random_windows, train_by_the_book
from semgrid_eval.models.encoder_decoder import EncoderDecoderSettings
from semgrid_eval.models.network import input_planes


def test_a_window_prepared_by_itself_is_that_of_a_batch():
    windows = random_windows()
    batch = windows.batch(torch.tensor([0, 33, 79]))
    planes = input_planes(batch.past)
    for row, index in enumerate((0, 33, 79)):
        inputs, target, mask = prepare_window(windows, index)
        assert torch.equal(inputs, planes[row])
        assert torch.equal(target, batch.target[row])
        assert torch.equal(mask, batch.mask[row])
    assert windows.shift_cells.unique().numel() > 3


def test_every_epoch_is_timed():
    seconds = train_by_the_book(
        EncoderDecoderSettings(features=2, depth=2),
        random_windows(4),
        batch=1,
        updates=1,
        epochs=2,
        device=torch.device("cpu"),
    )
    assert len(seconds) == 2
    assert min(seconds) > 0.0
