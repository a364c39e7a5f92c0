"""The grids of one recording, and the file that keeps those of a log."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays

FORMAT_VERSION = 3

_ALONG_FRAMES = {"stamps_ns": 0, "grids": 1, "position_m": 0, "yaw_rad": 0}
"""Arrays of a recording, and the axis of their frames."""


@dataclass(frozen=True)
class GridRecording:
    """The grids of one recording, all in the orientation of its first frame (reading 18)."""

    name: str  # of the recording; the stretches of a longer log are told apart by `#1`, `#2`, ...
    log: str  # path of its log
    digest: str  # of the log's bytes
    split: str  # `train`, `val` or `test`
    dataset: str  # where it comes from
    sensors: tuple[str, ...]  # names, in the order of `grids`; a target of several sensors is one of them
    target: str  # which of them the targets come from
    stamps_ns: NDArray[np.int64]  # (F,) times of the first of the target's sensors
    grids: NDArray[np.uint8]  # (S, F, H, W) uint8 class ids; each grid is centred on the vehicle at its own time
    position_m: NDArray[np.float64]  # (F, 2) of the vehicle, forward and left of the first frame
    yaw_rad: NDArray[np.float64]  # (F,) heading against the first frame
    # (F, H, W) uint8, where true actors stand at each frame's time: bits `STANDING` and `MOVING` of the grid's spec;
    # None where the log does not hold the truth.
    actors: NDArray[np.uint8] | None = None
    group: str = ""  # the town, city or drive that the log belongs to; empty where it does not say
    has_checksums: bool = True  # whether the log has them, so that damage can be seen
    recovered: str = ""  # of a log that was recovered from a damaged one, what it lost; the log says it, not the grids


def write_recordings(path: Path, recordings: Sequence[GridRecording], *, owner: str) -> None:
    """Write the grids of a log's stretches, one after the other along their frames, sealed for an `owner`."""
    first = recordings[0]
    truth = [recording.actors for recording in recordings if recording.actors is not None]
    arrays: dict[str, NDArray[np.generic]] = {
        "log": np.array([first.digest, first.split, first.dataset, first.group, first.target]),
        "has_checksums": np.array([first.has_checksums]),
        "sensors": np.array(first.sensors),
        "names": np.array([recording.name for recording in recordings]),
        "frames": np.array([len(recording.stamps_ns) for recording in recordings]),
        "has_truth": np.array([recording.actors is not None for recording in recordings]),
    }
    for name, axis in _ALONG_FRAMES.items():
        arrays[name] = np.concatenate([getattr(recording, name) for recording in recordings], axis=axis)
    arrays["actors"] = np.concatenate(truth) if truth else np.zeros((0, *first.grids.shape[2:]), np.uint8)
    write_arrays(path, arrays, owner=owner)


def read_recordings(path: Path, log: Path, *, owner: str, recovered: str = "") -> list[GridRecording]:
    """Read the grids of a log's stretches in one pass; `recovered` is what the log lost.

    Raises:
        ResultError: the file is missing, damaged, lacks an array or belongs to another `owner`.
    """
    arrays = read_arrays(
        path,
        ("log", "has_checksums", "sensors", "names", "frames", "has_truth", *_ALONG_FRAMES, "actors"),
        owner=owner,
    )
    digest, split, dataset, group, target = (str(value) for value in arrays["log"])
    ends, has_truth = np.cumsum(arrays["frames"])[:-1], arrays["has_truth"]
    parts = {name: np.split(arrays[name], ends, axis=axis) for name, axis in _ALONG_FRAMES.items()}
    truth = iter(np.split(arrays["actors"], np.cumsum(arrays["frames"][has_truth])))
    return [
        GridRecording(
            name=str(name),
            log=str(log),
            digest=digest,
            split=split,
            dataset=dataset,
            group=group,
            recovered=recovered,
            has_checksums=bool(arrays["has_checksums"][0]),
            sensors=tuple(str(sensor) for sensor in arrays["sensors"]),
            target=target,
            actors=next(truth) if has_truth[number] else None,
            **{key: stretches[number] for key, stretches in parts.items()},
        )
        for number, name in enumerate(arrays["names"])
    ]
