"""RN: it begins as its table, works on any grid, each part can be left out, and it learns what moves."""

from dataclasses import replace

import pytest
import torch
from support.models import given, network
from support.recordings import random_recording

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES
from semgrid_eval.models.prior import CellPrior
from semgrid_eval.models.residual import LEAD_BINS, Residual
from semgrid_eval.windows.data import WindowBatch, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

SMALL = {"widths": [8, 8], "fine": 4}
CAR = CLASS_NAMES.index("car")


def batch_of(rows=16, columns=16, *, sensors=1, inputs=2, windows=2):
    draw = torch.Generator().manual_seed(3)
    past = torch.randint(0, CLASS_COUNT, (windows, sensors, inputs, rows, columns), generator=draw, dtype=torch.uint8)
    target = past[:, 0, -1].clone()
    return WindowBatch(
        past=past,
        sensors=tuple(map(str, range(sensors))),
        shift_cells=torch.zeros(windows, inputs, 2, dtype=torch.int64),
        lead_s=torch.full((windows, inputs), 0.3),
        target=target,
        mask=torch.zeros_like(target, dtype=torch.bool),
    )


def some_windows():
    data = stack_recordings([random_recording(1, frames=8, size=16)], cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(inputs=2, step_frames=1))
    return select_windows(data, plan.windows, sensors=("full",))


@pytest.mark.parametrize("settings", [{}, {"shift": 1}, {"lead_input": True}])
def test_it_begins_as_its_table(settings):
    windows = some_windows()
    net = network(Residual, **SMALL, **settings).eval()
    table = CellPrior(given(), lead_bins=LEAD_BINS if "lead_input" in settings else 1)
    net.prepare(windows)
    table.count(windows)
    batch = windows.batch(slice(4))
    if settings == {"shift": 1}:  # what moves is moved by next to nothing
        assert (net(batch) - table(batch)).abs().max() < 0.2
    else:
        assert torch.equal(net(batch), table(batch))


@pytest.mark.parametrize(("rows", "columns"), [(16, 16), (13, 10), (5, 7)])
def test_grids_of_any_size_are_answered_cell_for_cell(rows, columns):
    net = network(Residual, **SMALL, shift=1).eval()
    assert net(batch_of(rows, columns)).shape == (2, CLASS_COUNT, rows, columns)


@pytest.mark.parametrize(
    "settings", [{"fine": 0}, {"prior": False}, {"shift": 2}, {"lead_input": True}, {"widths": [8]}]
)
def test_each_part_can_be_left_out_and_every_weight_learns(settings):
    net = network(Residual, given(sensors=("a", "b")), **{**SMALL, **settings}).train()
    if settings.get("prior", True):  # weights before a layer of zeros get no gradient
        torch.nn.init.normal_(net.classify.weight)
    batch = batch_of(sensors=2)
    net.loss(net(batch).float(), batch).backward()
    assert [name for name, value in net.named_parameters() if value.grad is None or not value.grad.any()] == []


def test_the_shift_mixture_moves_cars_where_it_is_told_to():
    net = network(Residual, widths=[4], fine=0, prior=False, shift=1).eval()
    for value in (net.classify.weight, net.classify.bias):
        torch.nn.init.zeros_(value)
    with torch.no_grad():
        net.shift.choose.bias.fill_(-50)
        net.shift.choose.bias[5] = 50.0  # of 3 x 3 displacements: content comes from the right, so it moves left
        net.shift.gate.weight.zero_()
        net.shift.gate.bias.fill_(50)
    batch = batch_of(windows=1)
    past = torch.zeros_like(batch.past)
    past[0, 0, -1, 6, 8] = CAR
    change = net(replace(batch, past=past))[0]
    expected = torch.zeros(CLASS_COUNT, 16, 16)
    expected[CAR, 6, 6], expected[CAR, 6, 8] = 3.0, -3.0
    torch.testing.assert_close(change, expected)


def test_it_is_told_the_lead_only_on_request():
    batch = batch_of()
    later = replace(batch, lead_s=batch.lead_s + 0.5)
    for told in (False, True):
        net = network(Residual, **SMALL, prior=False, lead_input=told).eval()
        assert torch.equal(net(batch), net(later)) is not told


def test_what_is_set_of_the_training_lies_over_the_networks_own():
    own = Residual.parse_settings({}).training
    changed = Residual.parse_settings({"training": {"batch": 4, "schedule": {"learning_rate": 1e-3}}}).training
    assert changed == own.model_copy(
        update={"batch": 4, "schedule": own.schedule.model_copy(update={"learning_rate": 1e-3})}
    )
