"""One log of Argoverse as a recording: its files, their digest, and the moments they hold."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.geometry import SE3
from semgrid_eval.recording import road_map
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.recording.types import Moment, Recording
from semgrid_eval.sources.argoverse2.city_map import city_of, find_archive, read_map
from semgrid_eval.sources.argoverse2.tables import MAX_FILE_BYTES, read_table
from semgrid_eval.sources.argoverse2.tracks import actors_of, read_boxes, read_poses
from semgrid_eval.sources.poses import motion_of, planar

DATASET = "argoverse2"
LIDAR = "top"
"""Name in logs of the two scanners on the roof, whose sweeps come as one."""
_IN_VEHICLE = Mount.of(SE3(np.eye(3), np.zeros(3)))  # where Argoverse gives the points of a sweep
_POINTS = {**dict.fromkeys(("x", "y", "z"), "float64"), "intensity": "float64"}
_STAMP = re.compile(r"[0-9]{1,19}")
_CONVERSION_VERSION = 1  # to be raised when the same files give another recording


@dataclass(frozen=True)
class Drive:
    """The folder of a log, which is its name; faults are InputErrors that name a file."""

    folder: Path
    split: str

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.folder.name

    @property
    def sweeps(self) -> dict[int, Path]:
        """The files of the LiDAR's sweeps by time."""
        found = (self.folder / "sensors" / "lidar").glob("*.feather")
        return {int(path.stem): path for path in sorted(found) if _STAMP.fullmatch(path.stem)}

    def digest(self) -> str:
        """Digest the bytes of all files that are used."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        used = [self._boxes, self._poses, find_archive(self.folder), *self.sweeps.values()]
        for path in used:
            if not path.is_file():
                raise InputError("is missing", path=path)
        names = [path.name for path in used]
        content = digest_files(used, limit=MAX_FILE_BYTES)
        return digest_value([_CONVERSION_VERSION, self.name, self.split, names, content])

    def recording(self) -> Recording:
        """Return the recording; sweeps are read while it is streamed."""
        archive = find_archive(self.folder)
        return Recording(
            name=self.name,
            dataset=DATASET,
            split=self.split,
            group=city_of(archive) or self.name,
            calibrations={},
            source_digest=self._digest,
            moments=self._moments,
            source_files={road_map.FILE: read_map(archive).to_json()},
        )

    @property
    def _boxes(self) -> Path:
        return self.folder / "annotations.feather"

    @property
    def _poses(self) -> Path:
        return self.folder / "city_SE3_egovehicle.feather"

    def _moments(self) -> Iterator[Moment]:
        boxes = read_boxes(self._boxes)
        stamps_ns: list[int] = np.unique(boxes["timestamp_ns"]).tolist()
        if len(stamps_ns) < 2:
            raise InputError("has boxes of a single time; motion needs more", path=self._boxes)
        places = read_poses(self._poses, stamps_ns)
        actors = actors_of(boxes, places, self._boxes)
        poses = [planar(stamp_ns, places[stamp_ns]) for stamp_ns in stamps_ns]
        sweeps = self.sweeps
        for pose, sample in zip(poses, motion_of(poses), strict=True):
            now_ns = pose.stamp_ns
            seen = {LIDAR: _sweep(now_ns, sweeps[now_ns])} if now_ns in sweeps else {}
            yield Moment(now_ns, {}, (sample,), pose, actors[now_ns], seen)


def _sweep(stamp_ns: int, path: Path) -> LidarSweep:
    table = read_table(path, _POINTS)
    points_m = np.stack([table[name] for name in "xyz"], axis=1).astype(np.float32)
    with located(path=path):
        return LidarSweep(stamp_ns, _IN_VEHICLE, points_m, table["intensity"].astype(np.float32), None)
