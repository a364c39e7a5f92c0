"""A unit resolved: its model, windows, training and the ids under which all of it is kept."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from semgrid_eval.config import Config
from semgrid_eval.files import digest_value
from semgrid_eval.grids.recording import FORMAT_VERSION as GRIDS
from semgrid_eval.models.model import Model
from semgrid_eval.runs.data import grid_digest
from semgrid_eval.runs.row import Row
from semgrid_eval.scores import results
from semgrid_eval.streams.plan import StreamPlan
from semgrid_eval.windows.data import WindowSet

SCORING_VERSION = 3  # counts changes to how windows are kept and scored; results of another version are made again


@dataclass(frozen=True)
class Resolved:
    """The model of a row with its settings."""

    model: type[Model]
    settings: Config
    version: str  # tells its code, and files that it declares, from others of the same name
    is_own: bool = False  # whether it is code of one's own

    @property
    def is_known(self) -> bool:
        """Whether all files that its numbers depend on are known, so that its results can be kept."""
        return self.model.files is not None


@dataclass(frozen=True)
class Training:
    """What a row's model learns from; rows that ask for the same share it."""

    id: str
    folder: Path  # of a network's weights and history
    windows: WindowSet
    watched: WindowSet | None  # the windows whose loss a network's training notes


@dataclass(frozen=True)
class Job:
    """A row with one seed, resolved."""

    row: Row
    seed: int | None
    resolved: Resolved
    result_id: str  # names the result's folder
    config: dict[str, object]  # what determined it, for the record, and the colours of its classes
    scored: WindowSet  # validation windows; `windows_id` names their file
    windows_id: str
    training: Training | None  # what is learned from, if anything
    left_out: dict[str, str]  # logs whose recordings are too short for the row's windows, and by how much
    stream: StreamPlan | None = None  # of a row that is scored as its answers come; `scored` are these


def id_of_windows(row: Row, scored: WindowSet) -> str:
    """Digest what decides the windows that a run keeps."""
    return digest_value([SCORING_VERSION, GRIDS, scored.digest(), grid_digest(row.grid), list(row.grid.classes.names)])


def id_of_result(config: Mapping[str, object], windows_id: str, training_id: str | None, seed: int | None) -> str:
    """Digest all that decides a result: its row with what that depends on, its windows, and what was learned.

    The grid in `config` is its identity: colours decide nothing.
    """
    return digest_value([results.FORMAT_VERSION, SCORING_VERSION, config, windows_id, [training_id, seed]])


def target_key(job: Job) -> str:
    """Digest what rows must share to be subtracted: target frames of which logs, their grids, mask mode and split.

    Streams have another mask M, so they share theirs with streams alone.
    """
    row, data = job.row, job.scored.data
    frames = job.stream.evaluated if job.stream else job.scored.target_frames.cpu().numpy()
    owners, places = data.locate(frames)
    digests = [data.digests[owner] for owner in owners]
    targets = sorted(zip(digests, data.stamps_ns[frames].tolist(), places.tolist(), strict=True))
    kind = ["stream"] if job.stream else []
    return digest_value(
        [targets, row.grid.target_identity(), row.mask_mode, row.scored_split, list(row.grid.classes.names), *kind]
    )


def window_records(windows: WindowSet, log_of: dict[str, str]) -> tuple[results.WindowRecord, ...]:
    """Describe windows for a result's record; `log_of` has the path of each recording's log."""
    data = windows.data
    frames, inputs = windows.target_frames.cpu().numpy(), windows.inputs.cpu().numpy()
    return tuple(
        results.WindowRecord(
            recording=data.recordings[owner],
            log=log_of[data.recordings[owner]],
            target_frame=int(target),
            target_stamp_ns=int(data.stamps_ns[frame]),
            input_stamps_ns=tuple(data.stamps_ns[past].tolist()),
        )
        for frame, past, owner, target in zip(frames, inputs, *data.locate(frames), strict=True)
    )
