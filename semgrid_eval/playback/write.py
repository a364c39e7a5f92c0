"""Rows of a run as one MCAP log to play in a viewer: targets, predictions, masks, certainty and inputs."""

import json
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file, write_text
from semgrid_eval.grids.shown import shown_camera, shown_lidar
from semgrid_eval.log.codec import PLAYBACK_RECORD, PREDICTIONS_RECORD
from semgrid_eval.log.predictions import RECORDING
from semgrid_eval.log.writer import MessageWriter
from semgrid_eval.playback.again import Again
from semgrid_eval.playback.backdrop import Backdrop
from semgrid_eval.playback.layout import viewer_layout
from semgrid_eval.playback.live import PlayedStreams
from semgrid_eval.playback.place import LAYOUT, digest_of, require_place
from semgrid_eval.playback.played import PlayedWindows
from semgrid_eval.playback.refit import Sources
from semgrid_eval.playback.scored import (
    Scored,
    choose_recordings,
    find_row,
    open_scored_log,
    read_scored,
    read_streamed,
    require_alike,
)
from semgrid_eval.playback.windows import kept_windows
from semgrid_eval.progress import Progress, silent
from semgrid_eval.scores import results

GAP_NS = 1_000_000_000
"""Between recordings that are played one after the other: those of one town may overlap in time."""


@dataclass(frozen=True)
class Play:
    """What to play.

    Attributes:
        run: folder of the run.
        rows: names of rows, which have to have predictions; their topics are numbered from 1 in this order.
        logs: folder of the run's logs; with it come pictures, calibration, the vehicle's way, and every possible target
            instead of those that were scored.
        trainings: folder of the run's trainings, its own if not given.
        grids: folder in which the run keeps grids, its own if not given.
        recording: the one to play; the first if not given.
        every_recording: play all of them one after the other, later ones shifted in time.
        live: play the recording that streams keep as a viewer would have seen it, see `playback.live`.
    """

    run: Path
    rows: tuple[str, ...]
    logs: Path | None = None
    trainings: Path | None = None
    grids: Path | None = None
    recording: str | None = None
    every_recording: bool = False
    live: bool = False

    @property
    def sources(self) -> Sources | None:
        """What predictions are made from again, where there are logs."""
        if self.logs is None:
            return None
        trainings, grids = self.trainings or self.run / "trainings", self.grids or self.run / "grids"
        return Sources(self.run, trainings, grids, self.logs)


@dataclass(frozen=True)
class Playback:
    """What was written: the log, the layout for viewers beside it, the recordings in it, and what is to be said."""

    log: Path
    layout: Path
    recordings: tuple[str, ...]
    notes: tuple[str, ...] = ()


def write_playback(play: Play, out: Path, *, force: bool = False, progress: Progress = silent) -> Playback:
    """Write what rows predicted as an MCAP log, and a layout for Foxglove and Lichtblick beside it.

    Inputs are moved to the target's time, also those of a row that saw them not moved.

    Args:
        play: which rows of which run, and what of them.
        out: the log to write.
        force: replace `out` and the layout beside it, whatever they are; else only an earlier log of this kind.
        progress: told of each recording.

    Raises:
        InputError: row, recording or predictions do not exist, a log is missing or not the one that was scored, rows
            have different targets, or `out` may not be written.
    """
    if play.logs is not None and out.resolve().is_relative_to(play.logs.resolve()):
        raise InputError("lies in the folder of logs, where it would be taken for one", path=out)
    player = _Player(play)
    chosen = choose_recordings(player.rows, play.recording, every_recording=play.every_recording)
    layout, text = out.with_suffix(".layout.json"), player.layout(chosen[-1])
    require_place(out, layout, text, (log.path for log in player.record.logs), force=force)
    shifts_ns: dict[str, int] = {}  # what was added to each recording's times
    with atomic_file(out) as stream, MessageWriter(stream) as writer:
        end_ns = None
        for done, name in enumerate(chosen, start=1):
            with ExitStack() as stack:
                played = player.played(name, stack)
                shift_ns = 0 if end_ns is None else end_ns + GAP_NS - played.first_ns
                for sent in played.messages(shift_ns):
                    writer.write(**sent._asdict())
            shifts_ns[name], end_ns = shift_ns, played.last_ns + shift_ns
            progress(done, len(chosen), name)
        if len(chosen) == 1:  # times of others are shifted
            writer.metadata(PREDICTIONS_RECORD, {RECORDING: chosen[0]})
        told = {LAYOUT: digest_of(text.encode()), "shift_ns": json.dumps(shifts_ns)}
        writer.metadata(PLAYBACK_RECORD, player.metadata() | told)
        write_text(layout, text)
    return Playback(out, layout, tuple(chosen), tuple(player.notes))


class _Player:
    """The rows that are played, and their recordings."""

    def __init__(self, play: Play) -> None:
        self._logs, self._live = play.logs, play.live
        self.record = results.read_run(play.run)
        read = read_streamed if play.live else read_scored
        self.rows: tuple[Scored, ...] = tuple(
            read(play.run, find_row(self.record, name, play.run)) for name in play.rows
        )
        require_alike(self.rows)
        self._again = Again(play.sources) if play.sources else None

    @property
    def notes(self) -> list[str]:
        """What is to be said of the predictions that were made again."""
        return self._again.notes if self._again else []

    def played(self, name: str, stack: ExitStack) -> PlayedWindows | PlayedStreams:
        """Open what is played of a recording."""
        first = self.rows[0]
        log = open_scored_log(self.record, first, name, self._logs, stack) if self._logs else None
        backdrop = Backdrop(log, first.grid) if log else None
        if self._live:
            return PlayedStreams(self.rows, backdrop)
        if log is None or not self._again:
            return PlayedWindows([kept_windows(row, name) for row in self.rows], None)
        return PlayedWindows([self._again.windows(row, name, log.path) for row in self.rows], backdrop)

    def layout(self, name: str) -> str:
        """Write the layout for what a recording's log shows."""
        camera = lidar = None
        if self._logs is not None:
            with ExitStack() as stack:
                log, grid = open_scored_log(self.record, self.rows[0], name, self._logs, stack), self.rows[0].grid
                camera, lidar = shown_camera(log, grid), shown_lidar(log, grid)
        layout = viewer_layout([row.is_unsure for row in self.rows], camera, lidar, inputs=not self._live)
        return json.dumps(layout, indent=2, sort_keys=True, allow_nan=False) + "\n"

    def metadata(self) -> dict[str, str]:
        """Say what is played."""
        rows = [{"row": row.row.name, "result": row.record.id, "seed": row.record.seed} for row in self.rows]
        return {"run": self.record.title, "rows": json.dumps(rows)}
