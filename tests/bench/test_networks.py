"""The textbook's training is a fair twin: it sees what ours sees, and learns what ours learns."""

import torch

from semgrid_eval.bench.networks import encoder_decoder, prepare_window, random_windows, train_by_the_book
from semgrid_eval.models import encoder_decoder as module
from semgrid_eval.models import training
from semgrid_eval.models.network import Network, ScheduleConfig, input_planes

CPU = torch.device("cpu")
RATE = 0.1


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


def test_the_textbook_learns_what_ours_does_from_the_same_windows(tmp_path, monkeypatch):
    order = torch.tensor([[[3, 1], [0, 2], [2, 3]]])
    monkeypatch.setattr(module, "DROPOUT_RATE", 0.0)  # whose draws depend on the layout of memory
    monkeypatch.setattr(training, "draw_windows", lambda *_: order.flatten())
    # RMSprop makes whole steps of gradients that are rounding errors alone.
    monkeypatch.setattr(Network, "optimizer", lambda self: torch.optim.SGD(self.parameters(), lr=RATE))
    subject = encoder_decoder(2)
    schedule = ScheduleConfig(learning_rate=RATE)
    settings = {"epochs": 1, "updates_per_epoch": 3, "batch": 2, "precision": "float32", "schedule": schedule}
    ours, textbooks, untrained = (subject.network(**settings) for _ in range(3))
    training.train(ours, random_windows(4), seed=0, device=CPU, folder=tmp_path)
    (seconds,) = train_by_the_book(textbooks.train(), random_windows(4), order, device=CPU)
    assert seconds > 0.0
    moved = 0.0
    for name, weight in ours.named_parameters():
        start, other = untrained.get_parameter(name), textbooks.get_parameter(name)
        torch.testing.assert_close(weight, other, rtol=0.0, atol=1e-4)
        moved = max(moved, float((weight - start).detach().abs().max()))
    assert moved > 1e-2
