"""RN-Flow: it begins as a table that knows where BL-Flow moves what moves, and is RN where nothing does."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from support.models import given, network
from support.recordings import recording

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.errors import ConfigError
from semgrid_eval.models.residual import LEAD_BINS, Residual
from semgrid_eval.models.residual_flow import ResidualFlow
from semgrid_eval.windows.data import select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import WindowConfig, training_windows

SMALL = {"widths": [8, 8], "fine": 4}
FAST = {"flow": {"speed_limit_mps": 100}}
ROAD, CAR = CLASS_NAMES.index("road"), CLASS_NAMES.index("car")
STEP = 4  # cells that a car comes ahead between two frames
SIZE = 24


def driving(column):
    """A car that comes down a road, frame by frame."""
    grids = np.full((1, 5, SIZE, SIZE), ROAD, np.uint8)
    for frame in range(5):
        grids[0, frame, frame * STEP : frame * STEP + 4, column : column + 2] = CAR
    return recording(grids, name=f"drive {column}")


@pytest.fixture(scope="module")
def windows():
    data = stack_recordings([driving(column) for column in (3, 9, 15)], cell_m=1.0)
    plan = training_windows(data.frame_counts, WindowConfig(inputs=2, step_frames=1))
    return select_windows(data, plan.windows, sensors=("full",))


@pytest.mark.parametrize("settings", [{}, {"lead_input": True}])
def test_it_begins_with_cars_where_they_drive_to_and_the_network_without_does_not(windows, settings):
    batch = windows.batch(slice(len(windows)))
    right = {}
    for model, own in ((Residual, {}), (ResidualFlow, FAST)):
        net = network(model, given(size=SIZE), **SMALL, **settings, **own).eval()
        net.prepare(windows)
        answer = net(batch).argmax(dim=1)
        right[model] = ((answer == CAR) & (batch.target == CAR)).sum() / (batch.target == CAR).sum()
        if model is ResidualFlow:
            assert torch.equal(answer, batch.target.long())
            assert len(net.prior.table) == (LEAD_BINS if settings else 1) * 3 * CLASS_COUNT**2
    assert right[ResidualFlow] == 1
    assert right[Residual] < 0.5


def test_it_is_shown_no_more_than_the_cells_that_the_motion_changes(windows):
    net = network(ResidualFlow, given(size=SIZE), **SMALL, **FAST).eval()
    batch = windows.batch(slice(1))
    shown = net.shown(batch)
    assert shown.past.shape == (1, 1, 3, SIZE, SIZE)
    assert torch.equal(shown.past[:, :, :2], batch.past)
    moved = shown.past[0, 0, 2]
    assert set(moved.unique().tolist()) == {UNKNOWN, ROAD, CAR}
    assert torch.equal(moved == CAR, (batch.target[0] == CAR))
    assert torch.equal(moved == ROAD, batch.past[0, 0, 1] == CAR)
    assert torch.equal(shown.lead_s[:, 2], batch.lead_s[:, 1])
    still = replace(batch, past=batch.past[:, :, :1].expand_as(batch.past))
    assert not net.shown(still).past[:, :, 2].any()


def test_several_sensors_are_one_to_what_looks_for_motion(windows):
    net = network(ResidualFlow, given(size=SIZE, sensors=("left", "right")), **SMALL, **FAST).eval()
    batch = windows.batch(slice(2))
    past = batch.past.repeat(1, 2, 1, 1, 1)
    past[:, 0, :, :, SIZE // 2 :] = past[:, 1, :, :, : SIZE // 2] = UNKNOWN
    shown = net.shown(replace(batch, past=past, sensors=("left", "right"))).past
    alone = network(ResidualFlow, given(size=SIZE), **SMALL, **FAST).shown(batch).past
    assert torch.equal(shown[:, 0, 2], alone[:, 0, 2])
    assert not shown[:, 1, 2].any()
    assert net(replace(batch, past=past)).shape == (2, CLASS_COUNT, SIZE, SIZE)


def test_what_cannot_move_is_refused():
    settings = parse_config(ResidualFlow.Settings, {})
    with pytest.raises(ConfigError, match=r"window\.inputs: motion is seen between two inputs, and there is one"):
        ResidualFlow.check(settings, given(inputs=1))
    assert ResidualFlow.in_words(settings).endswith("channels, shown what moves on")
