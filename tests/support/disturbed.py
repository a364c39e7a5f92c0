"""Windows of small grids whose inputs are disturbed."""

import numpy as np
from support.planned import planned
from support.recordings import recording

from semgrid_eval.config import parse_config
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.disturb.kinds import KINDS
from semgrid_eval.windows.grids import stack_recordings

SIDE = 9
SPEC = GridSpec(rows=SIDE, columns=SIDE, cell_m=1.0, agent_row=SIDE, agent_column=4)


def settings(*, kind, **disturb):
    """Read a disturbance as a row does."""
    return parse_config(KINDS[kind], disturb)


def windows_of(recordings, windows, *, spec=SPEC, translate=True, sensors=("full",)) -> WindowSet:
    """Select windows given as (recording, input frames, target frame)."""
    data = stack_recordings(recordings, cell_m=spec.cell_m)
    return select_windows(data, planned(*windows), sensors=sensors, translate=translate)


def batch_of(windows: WindowSet, *, spec=SPEC, **disturb):
    """Gather all windows, disturbed if a kind is given."""
    return windows.disturbed(settings(**disturb) if disturb else None, spec).batch(slice(None))


def numbered(frames: int, *, sensors=("full",), name="one", **changes):
    """Make a recording whose frame f (from 0) holds nothing but class f + 1."""
    grids = (
        np.ones((len(sensors), frames, SIDE, SIDE), np.uint8) * np.arange(1, frames + 1, dtype=np.uint8)[:, None, None]
    )
    return recording(grids, sensors=sensors, name=name, **changes)


def classes_of(past):
    """List the classes that each input holds: (B, S, T, H, W) -> B lists of T, for the first sensor."""
    return [[np.unique(grid).tolist() for grid in window[0].numpy()] for window in past]
