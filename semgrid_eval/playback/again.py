"""Predicts every possible target of a recording again, with what the row's result was made with and nothing else.

A run keeps the predictions of the windows that were scored, of the paper's rows one a recording. Here the grids of all
frames are made from the log again, and the row's model answers for every target that they have, on the CPU. Windows
that were scored stay as they were scored.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from semgrid_eval.errors import LogError, SemgridError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.recording import GridRecording
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.models.model import Model
from semgrid_eval.playback.refit import Sources, model_of, row_of
from semgrid_eval.playback.scored import Scored
from semgrid_eval.playback.windows import Frame, Grid, RowWindows, kept_frame, kept_windows
from semgrid_eval.runs.data import grid_digest
from semgrid_eval.runs.job import window_records
from semgrid_eval.runs.row import Row
from semgrid_eval.runs.selection import wanted_lead
from semgrid_eval.scores.evaluate import answered
from semgrid_eval.scores.results import WindowRecord
from semgrid_eval.windows.data import WindowSet, select_windows
from semgrid_eval.windows.grids import stack_recordings
from semgrid_eval.windows.plan import validation_windows

_BATCH = 16


@dataclass
class Again:
    """Rows of a run that predict again; `notes` say which do not and why, and what is predicted otherwise here."""

    sources: Sources
    notes: list[str] = field(default_factory=list, init=False)
    _ready: dict[str, tuple[Row, Model] | None] = field(default_factory=dict, init=False)
    _grids: dict[tuple[Path, str], list[GridRecording]] = field(default_factory=dict, init=False)

    def windows(self, scored: Scored, recording: str, log: Path) -> RowWindows:
        """Return all windows of a recording, or those that were scored where the row cannot predict again.

        Raises:
            LogError: its log gives no such grids.
        """
        if (ready := self._prepared(scored)) is None:
            return kept_windows(scored, recording)
        row, model = ready
        windows = _every_window(self._recording(log, recording, row.grid), row)
        records = window_records(windows, {recording: scored.log_of(recording)})
        return RowWindows(scored, records, lambda: self._frames(scored, windows, records, model))

    def _prepared(self, scored: Scored) -> tuple[Row, Model] | None:
        name = scored.row.name
        if name not in self._ready:
            try:
                row = row_of(scored)
                self._ready[name] = row, model_of(scored, row, self.sources)
            except SemgridError as error:
                self._ready[name] = None
                self.notes.append(f"row {name}: only what was scored of it is played: {error}")
        return self._ready[name]

    def _recording(self, log: Path, name: str, config: GridConfig) -> GridRecording:
        """Make the grids of a log; those of the last one are kept for its other recordings and other rows."""
        key = (log, grid_digest(config))
        if key not in self._grids:
            same_log = {other: made for other, made in self._grids.items() if other[0] == log}
            self._grids = {**same_log, key: build_log(log, config)}
        found = next((each for each in self._grids[key] if each.name == name), None)
        if found is None:
            raise LogError(f"gives no grids of {name}", path=log)
        return found

    def _frames(
        self, scored: Scored, windows: WindowSet, records: Sequence[WindowRecord], model: Model
    ) -> Iterator[Frame]:
        recording = windows.data.recordings[0]
        there = {scored.record.windows[index].target_stamp_ns: index for index in scored.windows_of[recording]}
        other, compared = 0, 0
        for start in range(0, len(windows), _BATCH):
            for place, frame in enumerate(_predicted(windows, slice(start, start + _BATCH), model)):
                window = records[start + place]
                if (index := there.get(window.target_stamp_ns)) is None:
                    yield Frame(window, *frame)
                    continue
                kept = kept_frame(scored, index)
                other, compared = other + int((kept.prediction != frame[3]).sum()), compared + kept.prediction.size
                yield kept
        if other:
            share = f"{100 * other / compared:.2g} % of the cells of the windows that were scored"
            self.notes.append(f"row {scored.row.name}: {share} of {recording} would be predicted otherwise here")


def _every_window(recording: GridRecording, row: Row) -> WindowSet:
    """Select the windows of every target that a recording has."""
    grid = row.grid
    data = stack_recordings([recording], cell_m=grid.spec.cell_m, classes=grid.classes, sensors=row.sensors)
    config = row.scored_window.model_copy(update={"target_frame": None})
    planned = validation_windows(data.frame_counts, config, wanted_lead(config, data))
    windows = select_windows(data, planned.windows, sensors=row.sensors, translate=row.translate)
    return windows.disturbed(row.disturb, grid.spec)


def _predicted(windows: WindowSet, chosen: slice, model: Model) -> Iterator[tuple[Grid, ...]]:
    """Predict some windows: their inputs, target, mask, prediction and certainty, one window after the other."""
    seen = windows.batch(chosen)
    answer = answered(model, seen)
    aligned = seen if windows.translate else replace(windows, translate=True).batch(chosen)
    grids = (aligned.past.numpy(), seen.target.numpy(), seen.mask.numpy().astype(np.uint8))
    return zip(*grids, answer.prediction, answer.certainty, strict=True)
