"""Which windows of which recordings a row trains on and is scored on, selected once for all rows that share them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.runs.data import GridSource, grid_digest
from semgrid_eval.runs.row import Row
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import GridData
from semgrid_eval.windows.lead import frames_of
from semgrid_eval.windows.plan import WindowConfig, WindowPlan
from semgrid_eval.words import plural

WindowPlanner = Callable[[Sequence[int], WindowConfig, Sequence[int]], WindowPlan]


@dataclass(frozen=True)
class Wanted:
    """Which windows of a folder of logs."""

    split: str
    config: WindowConfig
    plan: WindowPlanner
    leads_frames: tuple[int, ...] = ()
    groups: tuple[str, ...] = ()  # which are held out of the training, if any are
    held_out: bool = False  # whether these are wanted, or the others

    def recordings(self, groups: Sequence[str]) -> set[int]:
        """Choose recordings by their groups.

        Raises:
            InputError: a group is not among them.
        """
        for group in self.groups:
            if group not in groups:
                found = ", ".join(sorted(set(groups))) or "none"
                message = f"no recording of split {self.split!r} is of the group {group!r} (groups found: {found})"
                raise InputError(message, field="hold_out")
        chosen = {index for index, group in enumerate(groups) if group in self.groups}
        return chosen if self.groups and self.held_out else set(range(len(groups))) - chosen


def wanted_lead(config: WindowConfig, grids: GridData) -> tuple[int, ...]:
    """Return the lead in frames where it is given in ms; nothing where not.

    Raises:
        InputError: it is not as many frames of one recording as of another.
    """
    if config.lead_ms is None:
        return ()
    frames = {}
    for name, (begin, end) in zip(grids.recordings, pairwise(grids.first_frames), strict=True):
        if end - begin > 1:  # there is a rate
            frames[frames_of(config.lead_ms, grids.stamps_ns[begin:end])] = name
    if len(frames) > 1:
        counts = " and ".join(f"{plural(count, 'frame')} of {name}" for count, name in sorted(frames.items())[:2])
        raise InputError(f"{config.lead_ms:g} ms are {counts}; score recordings of one rate", field="window.lead_ms")
    return tuple(frames) or (1,)


class Selection:
    """The windows that were selected."""

    def __init__(self) -> None:
        self._selected: dict[object, tuple[WindowSet, dict[int, str]]] = {}

    def select(self, data: GridSource, row: Row, wanted: Wanted) -> tuple[WindowSet, dict[int, str]]:
        """Select windows once for all seeds and rows that share them, with the reasons why recordings are too short."""
        key = (data, grid_digest(row.grid), row.sensors, row.translate, wanted)
        if key not in self._selected:
            grids = data.data(row.grid, wanted.split)
            leads = wanted.leads_frames or wanted_lead(wanted.config, grids)
            planned = wanted.plan(grids.frame_counts, wanted.config, leads)
            kept = wanted.recordings(grids.groups)
            chosen = planned.windows[np.isin(planned.windows.recording, list(kept))]
            windows = select_windows(grids, chosen, sensors=row.sensors, translate=row.translate)
            too_short = {index: why for index, why in planned.too_short.items() if index in kept}
            self._selected[key] = windows, too_short
        return self._selected[key]


def first_of_each(windows: WindowSet) -> WindowSet:
    """Return the first window of each recording."""
    owners, _ = windows.data.locate(windows.target_frames.cpu().numpy())
    chosen = np.unique(owners, return_index=True)[1]
    parts = ("inputs", "target_frames", "shift_cells", "lead_s")
    return replace(windows, truth=None, answers=None, **{name: getattr(windows, name)[chosen] for name in parts})
