"""Read single files of a KITTI sequence; what is wrong with one is an InputError that names it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import read_bytes
from semgrid_eval.geometry import SE3
from semgrid_eval.recording.lidar import MAX_POINTS
from semgrid_eval.sources.kitti.labels import classes_of, label_ids
from semgrid_eval.words import plural

MAX_FILE_BYTES = 1 << 28
_MAX_TIME_S = 1e9
_POINT_BYTES, _LABEL_BYTES = 16, 4
_STILL = 1e-2  # by how much a rotation may fail to be one
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Calibration:
    """What `calib.txt` says; frames are optical (right, down, forward), camera 0 the left grey one."""

    path: Path
    matrices: dict[str, Floats]  # (3, 4) each, by name

    @property
    def left(self) -> Floats:
        """The projection from camera 0 to the left colour image."""
        return self._matrix("P2")

    @property
    def right(self) -> Floats:
        """The projection from camera 0 to the right colour image."""
        return self._matrix("P3")

    @property
    def camera_from_lidar(self) -> SE3:
        """From the scanner to camera 0."""
        return _rigid(self._matrix("Tr"), self.path, "Tr")

    def _matrix(self, name: str) -> Floats:
        if name not in self.matrices:
            raise InputError("is missing", path=self.path, field=name)
        return self.matrices[name]


def read_calibration(path: Path) -> Calibration:
    """Read `calib.txt`; what it lacks is an InputError where it is asked for."""
    found = {}
    for line in _lines(path):
        name, _, numbers = line.partition(":")
        if name in ("P2", "P3", "Tr"):
            found[name] = _numbers(numbers, 12, path, name).reshape(3, 4)
    return Calibration(path, found)


def read_times_ns(path: Path) -> NDArray[np.int64]:
    """Read `times.txt`, a line in seconds for each frame: (N,) ns, growing."""
    seconds = np.array([_numbers(line, 1, path, f"line {n}")[0] for n, line in enumerate(_lines(path), start=1)])
    if len(wrong := np.flatnonzero((seconds < 0) | (seconds > _MAX_TIME_S))):
        raise InputError(f"{seconds[wrong[0]]:g} s is not a time", path=path, field=f"line {wrong[0] + 1}")
    stamps_ns = np.rint(seconds * 1e9).astype(np.int64)
    if len(wrong := np.flatnonzero(np.diff(stamps_ns) <= 0)):
        raise InputError("is not after the line before", path=path, field=f"line {wrong[0] + 2}")
    return stamps_ns


def read_poses(path: Path) -> list[SE3]:
    """Read `poses.txt`: for each frame, where camera 0 is in the axes of its first frame."""
    found = []
    for number, line in enumerate(_lines(path), start=1):
        place = f"line {number}"
        found.append(_rigid(_numbers(line, 12, path, place).reshape(3, 4), path, place))
    return found


def read_points(path: Path) -> NDArray[np.float32]:
    """Read `velodyne/*.bin`: (N, 4) x, y, z in metres (forward, left, up) and reflectance."""
    data = read_file(path)
    if len(data) % _POINT_BYTES or len(data) // _POINT_BYTES > MAX_POINTS:
        fault = f"has {plural(len(data), 'byte')}, which are not points of {_POINT_BYTES} bytes, at most {MAX_POINTS}"
        raise InputError(fault, path=path)
    return np.frombuffer(data, "<f4").reshape(-1, 4)


def read_labels(path: Path) -> NDArray[np.uint8]:
    """Read `labels/*.label`, class and instance of each point, as Cityscapes label ids: (N,)."""
    data = read_file(path)
    if len(data) % _LABEL_BYTES:
        raise InputError(f"has {plural(len(data), 'byte')}, which are not labels of {_LABEL_BYTES} bytes", path=path)
    classes = classes_of(np.frombuffer(data, "<u4"))
    with located(path=path):
        return label_ids(classes)


def read_file(path: Path) -> bytes:
    """Read a whole file of at most 256 MiB."""
    if not path.exists():
        raise InputError("is missing", path=path)
    return read_bytes(path, limit=MAX_FILE_BYTES)


def _lines(path: Path) -> list[str]:
    try:
        return read_file(path).decode("ascii").splitlines()
    except UnicodeDecodeError as error:
        raise InputError("is not a text file", path=path) from error


def _numbers(text: str, count: int, path: Path, place: str) -> Floats:
    """Read so many finite numbers."""
    words = text.split()
    if len(words) != count:
        raise InputError(f"has {plural(len(words), 'number')}; {count} are needed", path=path, field=place)
    try:
        found = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(str(error), path=path, field=place) from error
    if not np.isfinite(found).all():
        raise InputError("is not finite", path=path, field=place)
    return found


def _rigid(matrix: Floats, path: Path, place: str) -> SE3:
    turn = matrix[:, :3]
    if np.abs(turn @ turn.T - np.eye(3)).max() > _STILL or np.linalg.det(turn) < 0:
        raise InputError("is not a rotation and a way", path=path, field=place)
    return SE3(turn, matrix[:, 3])
