"""One log of Argoverse as a recording: its files, their digest, and the moments they hold."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.recording import road_map
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.recording.types import CameraFrame, Moment, Recording
from semgrid_eval.sources.argoverse2.city_map import city_of, find_archive, read_map
from semgrid_eval.sources.argoverse2.pairs import Pair, pairs_of, stamped
from semgrid_eval.sources.argoverse2.stereo import CAMERA, StereoCamera, calibration_files
from semgrid_eval.sources.argoverse2.tables import MAX_FILE_BYTES, read_table
from semgrid_eval.sources.argoverse2.tracks import actors_of, read_boxes, read_poses
from semgrid_eval.sources.argoverse2.vehicle import EGO_FROM_ARGOVERSE
from semgrid_eval.sources.poses import motion_of, planar

DATASET = "argoverse2"
LIDAR = "top"
"""Name in logs of the two scanners on the roof, whose sweeps come as one."""
_IN_VEHICLE = Mount.of(EGO_FROM_ARGOVERSE)  # where Argoverse gives the points of a sweep
_POINTS = {**dict.fromkeys(("x", "y", "z"), "float64"), "intensity": "float64"}
_CONVERSION_VERSION = 2  # to be raised when the same files give another recording


@dataclass(frozen=True)
class Drive:
    """The folder of a log, which is its name; faults are InputErrors that name a file."""

    folder: Path
    split: str
    stereo_every: int  # every how many pairs of images one is taken; 0: none

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.folder.name

    @cached_property
    def sweeps(self) -> dict[int, Path]:
        """The files of the LiDAR's sweeps by time."""
        return stamped(self.folder / "sensors" / "lidar", "*.feather")

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """The pairs of images that are taken; an InputError says that there are images, but no pair."""
        return pairs_of(self.folder)[:: self.stereo_every] if self.stereo_every else ()

    def digest(self) -> str:
        """Digest the bytes of all files that are used."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        used = [self._boxes, self._poses, find_archive(self.folder), *self.sweeps.values(), *self._images]
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
            calibrations={CAMERA: StereoCamera(self.folder).calibration} if self.pairs else {},
            source_digest=self._digest,
            moments=self._moments,
            source_files={road_map.FILE: read_map(archive).to_json()},
        )

    @property
    def _images(self) -> list[Path]:
        """The files that the stereo camera is made of."""
        images = [path for pair in self.pairs for path in (pair.left, pair.right)]
        return [*calibration_files(self.folder), *images] if images else []

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
        frames = self._frames(stamps_ns[0], stamps_ns[-1])
        motion = dict(zip(stamps_ns, zip(poses, motion_of(poses), strict=True), strict=True))
        for now_ns in sorted({*motion, *frames}):
            cameras = {CAMERA: frames[now_ns]()} if now_ns in frames else {}
            if now_ns in motion:
                pose, sample = motion[now_ns]
                yield Moment(now_ns, cameras, (sample,), pose, actors[now_ns], self._seen(now_ns))
            else:
                yield Moment(now_ns, cameras)

    def _frames(self, first_ns: int, last_ns: int) -> dict[int, Callable[[], CameraFrame]]:
        """Return what makes the frames of the times in which motion is known."""
        within = [pair for pair in self.pairs if first_ns <= pair.stamp_ns <= last_ns]
        camera = StereoCamera(self.folder) if within else None
        return {pair.stamp_ns: partial(camera.frame, pair) for pair in within} if camera else {}

    def _seen(self, now_ns: int) -> dict[str, LidarSweep]:
        return {LIDAR: _sweep(now_ns, self.sweeps[now_ns])} if now_ns in self.sweeps else {}


def _sweep(stamp_ns: int, path: Path) -> LidarSweep:
    table = read_table(path, _POINTS)
    points_m = np.stack([table[name] for name in "xyz"], axis=1).astype(np.float32)
    with located(path=path):
        return LidarSweep(stamp_ns, _IN_VEHICLE, points_m, table["intensity"].astype(np.float32), None)
