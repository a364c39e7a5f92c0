"""What a run keeps of a log so that a report can show it: small pictures of the frames in windows, and the track.

`RUN/pictures/<key>.npz` holds that of one log for the sensor that leads grids of it, `<key>` being the digest of both
and of the integrator:

- `stamps_ns` (K,) int64, ascending; the files of all images, then of all labels, one after the other as `images` and
  `labels` uint8, and where each ends as `image_ends` and `label_ends` (K,) int64. An empty file stands for a picture
  that the log does not have.
- `faults` (M,) words: what is wrong with pictures of the log, one line each.
- `start_ns` (1,) int64, when the log begins; `track_ns` (F,) int64, times of all frames, `track` (F, 3) float64, poses
  of the vehicle there, and `projection` (3, 4) float64, as `Track` says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import ResultError
from semgrid_eval.files import digest_value
from semgrid_eval.grids.spec import GridConfig

FORMAT_VERSION = 2
PICTURES = "pictures"
_FILES = ("images", "image_ends", "labels", "label_ends")
_TRACK = ("start_ns", "track_ns", "track", "projection")
_ALL = ("stamps_ns", *_FILES, *_TRACK, "faults")


@dataclass(frozen=True)
class FramePictures:
    """The small pictures of one frame as files; empty where the log has none."""

    image: bytes = b""  # the camera's, as WebP
    label: bytes = b""  # Cityscapes label ids as palette PNG: the camera's, or, without one, a LiDAR's panorama


@dataclass(frozen=True, eq=False)
class Track:
    """Where vehicle and camera are at each frame of a log.

    The projection takes points in the vehicle frame (x, y, z, 1) to the image (w u, w v, w), u and v going from 0 at
    its left and upper edge to 1 at its right and lower one, w being the depth in metres.
    """

    start_ns: int  # when the log begins
    stamps_ns: NDArray[np.int64]  # (F,) of all frames
    poses: NDArray[np.float64]  # (F, 3) x and y (m), yaw (rad) of the vehicle in the log's odom frame, as grids move by
    projection: NDArray[np.float64]  # (3, 4); zeros where no camera is shown

    @property
    def has_camera(self) -> bool:
        """Whether pictures are those of a camera."""
        return bool(self.projection.any())


@dataclass(frozen=True, eq=False)
class LogPictures:
    """What is kept of a log: the track, pictures of frames by their stamps (ns), and what is wrong with the log's."""

    track: Track
    frames: Mapping[int, FramePictures] = field(default_factory=dict)
    faults: tuple[str, ...] = ()


def pictures_file(run: Path, log_digest: str, grid: GridConfig) -> Path:
    """Return where the pictures lie that go with a log's grids: of the sensor that leads their target."""
    if grid.camera is not None:
        leader: dict[str, object] = {"camera": grid.camera.camera}
    else:
        leader = {"leader": grid.leader.model_dump(mode="json"), "camera": grid.camera_beside}
    key = {"log": log_digest, "integrator": grid.integrator, "format": FORMAT_VERSION, **leader}
    return run / PICTURES / f"{digest_value(key)}.npz"


def write_pictures(path: Path, kept: LogPictures) -> None:
    """Write what is kept of a log atomically, equal things giving equal bytes; an InputError says why it cannot."""
    stamps_ns = sorted(kept.frames)
    images, image_ends = _joined([kept.frames[stamp].image for stamp in stamps_ns])
    labels, label_ends = _joined([kept.frames[stamp].label for stamp in stamps_ns])
    track = (np.array([kept.track.start_ns]), kept.track.stamps_ns, kept.track.poses, kept.track.projection)
    faults = np.array(kept.faults, np.str_)
    values = (np.array(stamps_ns, np.int64), images, image_ends, labels, label_ends, *track, faults)
    write_arrays(path, dict(zip(_ALL, values, strict=True)), owner=path.stem)


def read_pictures(path: Path) -> LogPictures:
    """Read what is kept of a log; a ResultError says that it is missing or malformed."""
    arrays = read_arrays(path, _ALL, owner=path.stem)
    stamps_ns = _checked(arrays, "stamps_ns", (-1,), np.int64, path).tolist()
    images = _cut(arrays, "images", "image_ends", path)
    labels = _cut(arrays, "labels", "label_ends", path)
    if not len(stamps_ns) == len(images) == len(labels):
        raise ResultError(f"frames: {len(stamps_ns)}, images: {len(images)}, labels: {len(labels)}", path=path)
    frames = {stamp: FramePictures(*files) for stamp, *files in zip(stamps_ns, images, labels, strict=True)}
    return LogPictures(_track(arrays, path), frames, _faults(arrays, path))


def read_track(path: Path) -> Track:
    """Read the track alone of what is kept of a log; a ResultError says that it is missing or malformed."""
    return _track(read_arrays(path, _TRACK, owner=path.stem), path)


def read_faults(path: Path) -> tuple[str, ...]:
    """Read alone what is wrong with a log's pictures; a ResultError says that the file is missing or malformed."""
    return _faults(read_arrays(path, ("faults",), owner=path.stem), path)


def _faults(arrays: Mapping[str, NDArray[Any]], path: Path) -> tuple[str, ...]:
    found = arrays["faults"]
    if found.ndim != 1 or found.dtype.kind != "U":
        raise ResultError(f"has shape {found.shape}, type {found.dtype}", path=path, field="faults")
    return tuple(found.tolist())


def _track(arrays: Mapping[str, NDArray[Any]], path: Path) -> Track:
    start_ns = int(_checked(arrays, "start_ns", (1,), np.int64, path)[0])
    stamps_ns = _checked(arrays, "track_ns", (-1,), np.int64, path)
    poses = _checked(arrays, "track", (len(stamps_ns), 3), np.float64, path)
    return Track(start_ns, stamps_ns, poses, _checked(arrays, "projection", (3, 4), np.float64, path))


def _joined(files: Sequence[bytes]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    return np.frombuffer(b"".join(files), np.uint8), np.array(list(accumulate(map(len, files))), np.int64)


def _cut(arrays: Mapping[str, NDArray[Any]], name: str, ends_name: str, path: Path) -> list[bytes]:
    data = _checked(arrays, name, (-1,), np.uint8, path)
    places = [0, *_checked(arrays, ends_name, (-1,), np.int64, path).tolist()]
    if places != sorted(places) or places[-1] != len(data):
        raise ResultError("is not one file after the other", path=path, field=name)
    return [data[start:end].tobytes() for start, end in pairwise(places)]


def _checked(
    arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[int, ...], kind: type[np.generic], path: Path
) -> NDArray[Any]:
    """Return an array that has the shape, -1 standing for any length, and the type that it should, and is finite."""
    values = arrays[name]
    fits = values.ndim == len(shape) and all(map(lambda wanted, found: wanted in (-1, found), shape, values.shape))
    if not fits or values.dtype != kind or not np.isfinite(values).all():
        raise ResultError(f"has shape {values.shape}, type {values.dtype}, or is not finite", path=path, field=name)
    return values
