"""The grids of one recording, in memory or in the file that keeps those of a log."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays

FORMAT_VERSION = 3
"""Counts changes to what grids hold; it is part of the ids of results."""
LAYOUT_VERSION = 2
"""Counts changes to how the file is laid out, which change no number: grids of another layout are made again."""

_ALONG_FRAMES = ("stamps_ns", "position_m", "yaw_rad")
"""Arrays of a recording whose first axis are its frames."""
_HEAD = ("log", "has_checksums", "sensors", "names", "frames", "has_truth", "size", *_ALONG_FRAMES)

Cells = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class RecordingGrids(ABC):
    """What is known of a recording's grids without their cells, all in the orientation of its first frame (reading 18).

    Each grid is centred on the vehicle at its own time.
    """

    name: str  # of the recording; the stretches of a longer log are told apart by `#1`, `#2`, ...
    log: str  # path of its log
    digest: str  # of the log's bytes
    split: str  # `train`, `val` or `test`
    dataset: str  # where it comes from
    sensors: tuple[str, ...]  # names; a target of several sensors is one of them
    target: str  # which of them the targets come from
    stamps_ns: NDArray[np.int64]  # (F,) times of the first of the target's sensors
    position_m: NDArray[np.float64]  # (F, 2) of the vehicle, forward and left of the first frame
    yaw_rad: NDArray[np.float64]  # (F,) heading against the first frame
    group: str = ""  # the town, city or drive that the log belongs to; empty where it does not say
    has_checksums: bool = True  # whether the log has them, so that damage can be seen
    recovered: str = ""  # of a log that was recovered from a damaged one, what it lost; the log says it, not the grids

    @property
    @abstractmethod
    def size(self) -> tuple[int, int]:
        """Rows and columns of a grid."""

    @property
    @abstractmethod
    def has_truth(self) -> bool:
        """Whether its log tells where true actors stand."""

    @abstractmethod
    def cells(self, sensor: str) -> Cells:
        """Return the grids of one sensor: (F, H, W) class ids."""

    @abstractmethod
    def flags(self) -> Cells:
        """Return where true actors stand at each frame's time, where that is known: (F, H, W).

        They are bits, `STANDING` and `MOVING` of the grid's spec.
        """


@dataclass(frozen=True, kw_only=True)
class GridRecording(RecordingGrids):
    """The grids of one recording in memory."""

    grids: Cells  # (S, F, H, W) class ids, sensors in their order
    actors: Cells | None = None  # (F, H, W) as `flags` says; None where the log does not hold the truth

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of a grid."""
        rows, columns = self.grids.shape[-2:]
        return rows, columns

    @property
    def has_truth(self) -> bool:
        """Whether its log tells where true actors stand."""
        return self.actors is not None

    def cells(self, sensor: str) -> Cells:
        """Return the grids of one sensor: (F, H, W) class ids."""
        cells: Cells = self.grids[self.sensors.index(sensor)]
        return cells

    def flags(self) -> Cells:
        """Return where true actors stand at each frame's time: (F, H, W)."""
        assert self.actors is not None, "the caller has asked whether the truth is known"
        return self.actors


@dataclass(frozen=True)
class KeptCells:
    """The place of a recording's cells in a file, from which they are read whenever they are asked for."""

    file: Path
    number: int  # of the recording in the file
    size: tuple[int, int]
    has_truth: bool

    def read(self, name: str) -> Cells:
        """Read one array.

        Raises:
            ResultError: the file is gone or damaged.
        """
        # The seal was compared when the recording was found, and the archive has a checksum of each array.
        return read_arrays(self.file, (name,), verify=False)[name]


@dataclass(frozen=True, kw_only=True)
class KeptRecording(RecordingGrids):
    """The grids of one recording in a file; a ResultError says that it is gone or damaged when they are read."""

    kept: KeptCells

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of a grid."""
        return self.kept.size

    @property
    def has_truth(self) -> bool:
        """Whether its log tells where true actors stand."""
        return self.kept.has_truth

    def cells(self, sensor: str) -> Cells:
        """Read the grids of one sensor and nothing else: (F, H, W) class ids."""
        return self.kept.read(_cells_name(self.kept.number, sensor))

    def flags(self) -> Cells:
        """Read where true actors stand at each frame's time: (F, H, W)."""
        return self.kept.read(_flags_name(self.kept.number))


def write_recordings(path: Path, recordings: Sequence[RecordingGrids], *, owner: str) -> None:
    """Write the grids of a log's stretches, sealed for an `owner`: each sensor's can be read without the others."""
    first = recordings[0]
    arrays: dict[str, NDArray[Any]] = {
        "log": np.array([first.digest, first.split, first.dataset, first.group, first.target]),
        "has_checksums": np.array([first.has_checksums]),
        "sensors": np.array(first.sensors),
        "names": np.array([recording.name for recording in recordings]),
        "frames": np.array([len(recording.stamps_ns) for recording in recordings]),
        "has_truth": np.array([recording.has_truth for recording in recordings]),
        "size": np.array(first.size),
    }
    for name in _ALONG_FRAMES:
        arrays[name] = np.concatenate([getattr(recording, name) for recording in recordings])
    for number, recording in enumerate(recordings):
        arrays |= {_cells_name(number, sensor): recording.cells(sensor) for sensor in first.sensors}
        if recording.has_truth:
            arrays[_flags_name(number)] = recording.flags()
    write_arrays(path, arrays, owner=owner)


def find_recordings(path: Path, log: Path, *, owner: str, recovered: str = "") -> list[KeptRecording]:
    """Find what a file keeps of a log's stretches, and compare all of it with its seal; `recovered` is what was lost.

    Raises:
        ResultError: the file is missing, damaged, lacks an array or belongs to another `owner`.
    """
    return list(_found(path, log, read_arrays(path, _HEAD, owner=owner), recovered))


def _found(path: Path, log: Path, head: dict[str, NDArray[Any]], recovered: str) -> Iterator[KeptRecording]:
    digest, split, dataset, group, target = (str(value) for value in head["log"])
    rows, columns = (int(value) for value in head["size"])
    ends = np.cumsum(head["frames"])[:-1]
    parts = {name: np.split(head[name], ends) for name in _ALONG_FRAMES}
    for number, name in enumerate(head["names"]):
        yield KeptRecording(
            name=str(name),
            log=str(log),
            digest=digest,
            split=split,
            dataset=dataset,
            group=group,
            recovered=recovered,
            has_checksums=bool(head["has_checksums"][0]),
            sensors=tuple(str(sensor) for sensor in head["sensors"]),
            target=target,
            kept=KeptCells(path, number, (rows, columns), bool(head["has_truth"][number])),
            **{key: stretches[number] for key, stretches in parts.items()},
        )


def _cells_name(number: int, sensor: str) -> str:
    return f"grids.{number}.{sensor}"


def _flags_name(number: int) -> str:
    return f"actors.{number}"
