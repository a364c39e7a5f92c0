"""A row's scored windows as one MCAP log to play in a viewer: target, prediction, mask, certainty and inputs."""

import heapq
import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.config import parse_config
from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file, write_text
from semgrid_eval.grids.extent import extent_of
from semgrid_eval.log import topics
from semgrid_eval.log.codec import transforms_message
from semgrid_eval.log.grids import CERTAINTY, CLASSES, MASK, GridLayer, exact_message, viewer_message
from semgrid_eval.log.predictions import RECORD as PREDICTIONS_RECORD
from semgrid_eval.log.predictions import RECORDING, Prediction, prediction_message
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.playback.backdrop import Backdrop, Outgoing, prediction_topic, viewer_layout
from semgrid_eval.playback.live import LiveMessages
from semgrid_eval.playback.place import LAYOUT, RECORD, digest_of, require_place
from semgrid_eval.playback.scored import (
    Scored,
    choose_recordings,
    find_row,
    open_scored_log,
    read_scored,
    read_streamed,
)
from semgrid_eval.progress import Progress, silent
from semgrid_eval.recording.types import Pose
from semgrid_eval.scores import results
from semgrid_eval.streams.config import StreamConfig

GAP_NS = 1_000_000_000
"""Between recordings that are played one after the other: those of one town may overlap in time."""


@dataclass(frozen=True)
class Playback:
    """What was written: the log, the layout for viewers beside it, and the recordings in it."""

    log: Path
    layout: Path
    recordings: tuple[str, ...]


def write_playback(
    run: Path,
    row_name: str,
    out: Path,
    *,
    logs: Path | None = None,
    recording: str | None = None,
    every_recording: bool = False,
    live: bool = False,
    force: bool = False,
    progress: Progress = silent,
) -> Playback:
    """Write the windows of a row as an MCAP log, and a layout for Foxglove and Lichtblick beside it.

    Inputs are moved to the target's time, also those of a row that saw them not moved.

    Args:
        run: folder of the run.
        row_name: the row, which has to have predictions.
        out: the log to write.
        logs: folder of the run's logs; with it come pictures, calibration and the vehicle's way.
        recording: the one to play; the first if not given.
        every_recording: play all of them one after the other, later ones shifted in time.
        live: play the recording that a stream keeps as a viewer would have seen it, see `playback.live`.
        force: replace `out` and the layout beside it, whatever they are; else only an earlier log of this kind.
        progress: told of each recording.

    Raises:
        InputError: row, recording or predictions do not exist, a log is missing or not the one that was scored, or
            `out` may not be written.
    """
    if logs is not None and out.resolve().is_relative_to(logs.resolve()):
        raise InputError("lies in the folder of logs, where it would be taken for one", path=out)
    record = results.read_run(run)
    scored = (read_streamed if live else read_scored)(run, find_row(record, row_name, run))
    chosen = choose_recordings(scored, recording, every_recording=every_recording)
    layout, text = out.with_suffix(".layout.json"), _layout_text(record, scored, chosen[-1], logs)
    require_place(out, layout, text, (log.path for log in record.logs), force=force)
    shifts_ns: dict[str, int] = {}  # what was added to each recording's times
    with atomic_file(out) as stream, MessageWriter(stream) as writer:
        end_ns = None
        for done, name in enumerate(chosen, start=1):
            with ExitStack() as stack:
                log = open_scored_log(record, scored, name, logs, stack) if logs is not None else None
                backdrop = Backdrop(log, scored.grid) if log is not None else None
                played = _live(scored, backdrop) if live else _Messages(scored, name, backdrop)
                shift_ns = 0 if end_ns is None else end_ns + GAP_NS - played.first_ns
                for sent in played.messages(shift_ns):
                    writer.write(**sent._asdict())
            shifts_ns[name], end_ns = shift_ns, played.last_ns + shift_ns
            progress(done, len(chosen), name)
        made = {"run": record.title, "row": row_name, "result": scored.record.id, LAYOUT: digest_of(text.encode())}
        if len(chosen) == 1:  # times of others are shifted
            writer.metadata(PREDICTIONS_RECORD, {RECORDING: chosen[0]})
        dumped = {"seed": json.dumps(scored.record.seed), "shift_ns": json.dumps(shifts_ns)}
        writer.metadata(RECORD, made | dumped)
        write_text(layout, text)
    return Playback(out, layout, tuple(chosen))


def _live(scored: Scored, backdrop: Backdrop | None) -> LiveMessages:
    return LiveMessages(scored, parse_config(StreamConfig, scored.record.config.get("stream")), backdrop)


def _layout_text(record: results.RunRecord, scored: Scored, name: str, logs: Path | None) -> str:
    """Write the layout for what a recording's log shows."""
    cameras: tuple[str, ...] = ()
    if logs is not None:
        with ExitStack() as stack:
            cameras = open_scored_log(record, scored, name, logs, stack).scene.cameras
    return json.dumps(viewer_layout(scored.row, cameras), indent=2, sort_keys=True, allow_nan=False) + "\n"


class _Messages:
    """The messages of one recording; a LogError says that the log lacks the frame of a target."""

    def __init__(self, scored: Scored, name: str, backdrop: Backdrop | None) -> None:
        self._scored, self._backdrop = scored, backdrop
        self._indices = scored.windows_of[name]
        self._windows = [scored.record.windows[i] for i in self._indices]
        self.first_ns, self.last_ns = (self._windows[i].target_stamp_ns for i in (0, -1))
        if backdrop is not None:
            self.first_ns = min(window.input_stamps_ns[0] for window in self._windows)

    def messages(self, shift_ns: int) -> Iterator[Outgoing]:
        """Iterate over all messages in the order of time, all times shifted."""
        return heapq.merge(self._around(shift_ns), self._grids(shift_ns), key=lambda sent: sent.log_ns)

    def _around(self, shift_ns: int) -> Iterator[Outgoing]:
        if self._backdrop is None:  # nothing is known of the vehicle's way: each grid lies where the last one did
            for window in self._windows:
                now = Pose(window.target_stamp_ns + shift_ns, 0.0, 0.0, 0.0)
                yield Outgoing(now.stamp_ns, topics.TRANSFORMS, transforms_message(now, {}))
            return
        # Grids have the orientation of the first frame of their stretch of the log.
        first = self._backdrop.frame_at(self._windows[0].target_stamp_ns) - self._windows[0].target_frame
        yaw_rad = self._backdrop.poses[first].yaw_rad
        yield from self._backdrop.messages(self.first_ns, self.last_ns, shift_ns=shift_ns, grid_yaw_rad=yaw_rad)

    def _grids(self, shift_ns: int) -> Iterator[Outgoing]:
        place, notes = extent_of(self._scored.grid.spec).place, {"row": self._scored.row.name}
        for index, window in zip(self._indices, self._windows, strict=True):
            for topic, values, layer, known_ns in self._layers(index, window):
                now_ns, publish_ns = window.target_stamp_ns + shift_ns, known_ns + shift_ns
                message = viewer_message(now_ns, values, layer, place)
                yield Outgoing(now_ns, topic, message, publish_ns, notes)
                if layer.names:
                    exact = exact_message(now_ns, values, layer, place)
                    if topic == prediction_topic(self._scored.row.name):
                        certainty = self._scored.arrays["certainty"][index]
                        exact = prediction_message(Prediction(values, now_ns, publish_ns, publish_ns, certainty), place)
                    yield Outgoing(now_ns, f"{topic}/exact", exact, publish_ns, notes)

    def _layers(
        self, index: int, window: results.WindowRecord
    ) -> Iterator[tuple[str, NDArray[np.uint8], GridLayer, int]]:
        """Return topic, values (H, W), their meaning and since when they could be known, of each grid of a window."""
        arrays, row, inputs_ns = self._scored.arrays, self._scored.row, window.input_stamps_ns
        for sensor, past in zip(row.facts.sensors, arrays["inputs"][index], strict=True):
            for back, (values, stamp_ns) in enumerate(zip(past[::-1], inputs_ns[::-1], strict=True)):
                topic = f"{topics.GRID_INPUT}/{sensor}" + (f"/before_{back}" if back else "")
                yield topic, values, CLASSES, stamp_ns
        yield topics.GRID_TARGET, arrays["target"][index], CLASSES, window.target_stamp_ns
        yield topics.GRID_MASK, arrays["mask"][index], MASK, window.target_stamp_ns
        yield prediction_topic(row.name), arrays["prediction"][index], CLASSES, inputs_ns[-1]
        yield topics.GRID_CERTAINTY, arrays["certainty"][index], CERTAINTY, inputs_ns[-1]
