"""Grids of whole recordings: read a log once, make the grids of every sensor, keep them by digest."""

import logging
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from semgrid_eval.errors import LogError, ResultError, SemgridError
from semgrid_eval.executors import Executor, InProcess, WorkerDied
from semgrid_eval.files import digest_value
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.actors import TrueActors
from semgrid_eval.grids.rasterise import Cells, grid_of
from semgrid_eval.grids.recording import (
    FORMAT_VERSION,
    LAYOUT_VERSION,
    GridRecording,
    KeptRecording,
    find_recordings,
    write_recordings,
)
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import EGO_MOTION
from semgrid_eval.motion import EgoMotion, MotionSample, implausible
from semgrid_eval.places import remove_stale
from semgrid_eval.progress import Progress, silent
from semgrid_eval.sensors.kinds import read_points, synchronise
from semgrid_eval.sensors.sensor import Points

_log = logging.getLogger(__name__)


@dataclass
class GridDataSet:
    """The grids of many logs, on disk; `failed` holds the reason for each log that gave none."""

    recordings: list[KeptRecording] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    splits: set[str] = field(default_factory=set)  # of all logs, also of those of which no grids were asked for
    built: int = 0
    reused: int = 0


def build_grids(
    logs: Sequence[Path],
    folder: Path,
    config: GridConfig,
    *,
    sensors: Sequence[str] | None = None,
    splits: Collection[str] | None = None,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> GridDataSet:
    """Make the grids of all logs, or take those that lie in `folder` already, as many at once as `executor` works on.

    A log that fails is noted with its reason and the others go on. The order of recordings is that of `logs`. Grids of
    all sensors are made; with `sensors`, recordings have those of these and of the target. With `splits`, logs of other
    splits are left alone. No cell stays in memory.
    """
    data = GridDataSet()
    remove_stale(folder)
    ready: dict[Path, list[KeptRecording]] = {}
    missing: list[Path] = []
    for log in logs:
        try:
            kept = _kept(log, folder, config)
            data.splits.add(kept.split)
            if splits is None or kept.split in splits:
                ready[log] = _only(_find(log, kept), sensors)
        except ResultError as error:
            missing.append(log)  # not made yet, or damaged
            if error.path and error.path.exists():
                _log.warning("%s; the grids are made again", error)
        except SemgridError as error:
            data.failed[str(log)] = _about(log, error)
    data.reused = len(ready)
    work = partial(_build_and_keep, folder=folder, config=config)
    for done, (index, failure) in enumerate((executor or InProcess()).run(work, missing), start=1):
        log = missing[index]
        progress(done, len(missing), log.stem)
        if failure is not None:
            data.failed[str(log)] = failure.reason if isinstance(failure, WorkerDied) else failure
            continue
        ready[log] = _only(_find(log, _kept(log, folder, config)), sensors)
        data.built += 1
    data.recordings = [recording for log in logs for recording in ready.get(log, [])]
    return data


def _only(recordings: list[KeptRecording], sensors: Sequence[str] | None) -> list[KeptRecording]:
    if sensors is None:
        return recordings
    first = recordings[0]
    kept = tuple(name for name in first.sensors if name in (*sensors, first.target))
    return [replace(recording, sensors=kept) for recording in recordings]


def build_log(log: Path, config: GridConfig) -> list[GridRecording]:
    """Make the grids of one log, cut into stretches.

    Raises:
        LogError: the log is damaged or lacks what a grid needs.
    """
    with LogReader(log) as reader:
        truth = TrueActors(reader, config.spec)
        found = [stretch.recording(reader, truth) for stretch in _stretches(reader, config)]
    if not found:
        raise LogError(f"sensor {config.target[0]} has no frames", path=log)
    if len(found) == 1:
        return found
    return [replace(each, name=f"{each.name}#{number}") for number, each in enumerate(found, start=1)]


def _stretches(reader: LogReader, config: GridConfig) -> Iterator["_Stretch"]:
    motion = EgoMotion(_plausible(reader), config.integrator)
    observations = read_points(reader, config.sensors, config.class_by_label())
    snapshots = synchronise(observations, config.sensors, config.target[0])
    for number, first in enumerate(snapshots):
        stretch = _Stretch(motion, config)
        for snapshot in chain([first], islice(snapshots, config.stretch_frames - 1)):
            stretch.add(*snapshot)
        if number == 0 or len(stretch) == config.stretch_frames:
            yield stretch  # the rest of a log that was cut is too short for the windows of the others


def _plausible(reader: LogReader) -> Iterator[MotionSample]:
    for sample in reader.motion():
        if fault := implausible(sample):
            place = f"{EGO_MOTION} at {sample.stamp_ns} ns: {fault[0]}"
            raise LogError(fault[1], path=reader.path, field=place)
        yield sample


class _Stretch:
    """Turns what sensors see into grids, frame by frame, all in the orientation of the first frame."""

    def __init__(self, motion: EgoMotion, config: GridConfig) -> None:
        self._motion, self._config = motion, config
        self._stamps_ns: list[int] = []
        self._places: list[SE2] = []
        self._grids: list[Cells] = []

    def __len__(self) -> int:
        return len(self._stamps_ns)

    def add(self, stamp_ns: int, points: Mapping[str, Points]) -> None:
        """Add the next frame: what sensors, by name, have seen last."""
        self._stamps_ns.append(stamp_ns)
        here = self._first_from_vehicle(stamp_ns)
        self._places.append(here)
        rows = [[points[name] for name in names if name in points] for names in self._config.rows.values()]
        self._grids.append(np.stack([self._grid(seen, here) for seen in rows]))

    def recording(self, reader: LogReader, truth: TrueActors) -> GridRecording:
        """Return all frames with what the log says of itself."""
        stamps_ns, yaw_rad = np.array(self._stamps_ns, np.int64), np.array([place.yaw_rad for place in self._places])
        return GridRecording(
            name=reader.scene.name,
            log=str(reader.path),
            digest=reader.digest,
            split=reader.scene.split,
            dataset=reader.scene.dataset,
            group=reader.scene.group,
            has_checksums=reader.has_checksums,
            sensors=tuple(self._config.rows),
            target=self._config.target_row,
            stamps_ns=stamps_ns,
            grids=np.stack(self._grids, axis=1),
            position_m=np.array([(place.x_m, place.y_m) for place in self._places]),
            yaw_rad=yaw_rad,
            actors=truth.flags(stamps_ns, yaw_rad),
        )

    def _grid(self, seen: Iterable[Points], here: SE2) -> Cells:
        return grid_of(((points, self._grid_from(points, here)) for points in seen), self._config)

    def _grid_from(self, points: Points, here: SE2) -> SE2:
        there = self._first_from_vehicle(points.stamp_ns)
        # Where both times are the same, points are turned alone.
        return SE2(there.x_m - here.x_m, there.y_m - here.y_m, there.yaw_rad)

    def _first_from_vehicle(self, stamp_ns: int) -> SE2:
        self._motion.check_cover(stamp_ns)
        there = self._motion.odom_from_vehicle(stamp_ns)
        return there.seen_from(self._motion.odom_from_vehicle(self._stamps_ns[0]))


def _build_and_keep(log: Path, folder: Path, config: GridConfig) -> str | None:
    try:
        kept = _kept(log, folder, config)
        write_recordings(kept.file, build_log(log, config), owner=kept.key)
    except SemgridError as error:
        return _about(log, error)
    return None


def _find(log: Path, kept: "_Kept") -> list[KeptRecording]:
    return find_recordings(kept.file, log, owner=kept.key, recovered=kept.recovered)


class _Kept(NamedTuple):
    """Where the grids of a log are kept, the digest by which they are sealed, its split, and what the log lost."""

    file: Path
    key: str
    split: str
    recovered: str


def _kept(log: Path, folder: Path, config: GridConfig) -> _Kept:
    with LogReader(log) as reader:
        key = grid_key(reader.digest, config)
        return _Kept(folder / grid_file(log.stem, key), key, reader.scene.split, str(reader.recovered() or ""))


def grid_key(log_digest: str, config: GridConfig) -> str:
    """Digest all that decides the grids of a log, and how they are kept."""
    versions = [FORMAT_VERSION, LAYOUT_VERSION]
    return digest_value({"log": log_digest, "config": config.identity(), "format": versions})


def grid_file(log: str, key: str) -> str:
    """Return the name of the file that keeps the grids of a log."""
    return f"{log}-{key}.npz"


def _about(log: Path, error: SemgridError) -> str:
    return str(error) if str(log) in str(error) else f"{log}: {error}"
