"""Baselines: by hand, and the overlay against a slow twin."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from support.models import given as given_by
from support.models import made
from support.planned import planned
from support.recordings import recording

from semgrid_eval.errors import ConfigError
from semgrid_eval.models.newest import RepeatNewest
from semgrid_eval.models.overlay import FuseAll, OverlaySensors, overlay
from semgrid_eval.windows.data import WindowBatch, select_windows
from semgrid_eval.windows.grids import stack_recordings

UPPER, LOWER = "split1_upper", "split1_lower"


def batch_of(past, sensors):
    """Make a batch of one window from past (S, T, H, W)."""
    past = torch.tensor(past, dtype=torch.uint8)[None]
    still = torch.zeros(1, past.shape[2], 2, dtype=torch.int64)
    target = torch.zeros(past[:, 0, 0].shape, dtype=torch.uint8)
    return WindowBatch(past, sensors, still, still[..., 0].float(), target, target.bool())


def predicted(predictor, batch):
    scores = predictor.predict(batch)
    assert torch.equal(scores.sum(dim=1), torch.ones(scores[:, 0].shape))
    return scores.argmax(dim=1)[0].tolist()


@given(seed=st.integers(0, 2**32 - 1), layers=st.integers(1, 5))
def test_overlay_takes_the_first_known_cell(seed, layers):
    random = np.random.default_rng(seed)
    grids = random.integers(0, 10, (2, layers, 4, 5), dtype=np.uint8) * random.integers(
        0, 2, (2, layers, 4, 5), np.uint8
    )
    expected = [[[next((int(v) for v in g[:, r, c] if v), 0) for c in range(5)] for r in range(4)] for g in grids]
    assert overlay(torch.from_numpy(grids)).tolist() == expected


def test_newest_grid_of_the_first_sensor_is_repeated():
    batch = batch_of([[[[1, 2]], [[3, 0]]], [[[4, 4]], [[5, 5]]]], ("full", "other"))
    assert predicted(made(RepeatNewest), batch) == [[3, 0]]


def test_translating_row_aligns_what_is_repeated():
    grids = np.zeros((1, 3, 8, 8), np.uint8)
    grids[0, :, 2, 2] = 6
    data = stack_recordings([recording(grids, position_m=[[0, 0], [1, 0], [3, -1]])], cell_m=1.0)
    for translate, cell in ((True, (4, 1)), (False, (2, 2))):
        windows = select_windows(data, planned((0, (0, 1), 2)), sensors=["full"], translate=translate)
        assert made(RepeatNewest).predict(windows.batch(slice(0, 1))).argmax(dim=1)[0].nonzero().tolist() == [
            list(cell)
        ]


def test_sensor_on_top_hides_the_other_where_it_knows_something():
    batch = batch_of([[[[9, 9, 9, 9]], [[0, 1, 2, 0]]], [[[9, 9, 9, 9]], [[3, 0, 4, 0]]]], (LOWER, UPPER))
    assert predicted(made(OverlaySensors, top=UPPER), batch) == [[3, 1, 4, 0]]
    assert predicted(made(OverlaySensors, top="lower"), batch) == [[3, 1, 2, 0]]


def test_fusing_lets_time_win_over_sensors():
    older, newer = [[1, 1, 1, 0, 1]], [[2, 0, 0, 0, 0]]
    older_top, newer_top = [[3, 3, 0, 0, 3]], [[4, 4, 0, 0, 0]]
    lower, upper = [older, newer], [older_top, newer_top]
    assert predicted(made(FuseAll), batch_of([lower, upper], (LOWER, UPPER))) == [[2, 4, 1, 0, 1]]
    assert predicted(made(FuseAll), batch_of([upper, lower], (UPPER, LOWER))) == [[4, 4, 1, 0, 3]]


@pytest.mark.parametrize("sensors", [("full",), ("full", LOWER), (UPPER, UPPER)])
def test_sensors_of_which_not_one_alone_is_on_top_are_refused(sensors):
    with pytest.raises(
        ConfigError,
        match=rf"settings\.top: 'upper' must be part of the name of one sensor alone, of {', '.join(sensors)}",
    ):
        OverlaySensors.check(OverlaySensors.Settings(), given_by(sensors=sensors))
