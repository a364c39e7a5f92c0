"""One log of Argoverse as a recording: its files, their digest, and the moments they hold."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError, located
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.recording import road_map
from semgrid_eval.recording.lidar import LidarSweep, Mount
from semgrid_eval.recording.types import CameraFrame, Moment, Recording
from semgrid_eval.sources.argoverse2.cameras import Look, calibration_files, stamped
from semgrid_eval.sources.argoverse2.city_map import city_of, find_archive, read_map
from semgrid_eval.sources.argoverse2.pairs import Pair, pairs_of
from semgrid_eval.sources.argoverse2.ring import Images, ring_images, ring_look
from semgrid_eval.sources.argoverse2.stereo import CAMERA, stereo_look
from semgrid_eval.sources.argoverse2.tables import MAX_FILE_BYTES, Table, read_table
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
    ring_every: int  # likewise of the images of each ring camera

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

    @cached_property
    def rings(self) -> dict[str, Images]:
        """The images that are taken of ring cameras."""
        return ring_images(self.folder, self.ring_every)

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
        looks = self._looks(self._times_ns(read_boxes(self._boxes)))
        return Recording(
            name=self.name,
            dataset=DATASET,
            split=self.split,
            group=city_of(archive) or self.name,
            calibrations={name: look.calibration for name, look in looks.items()},
            source_digest=self._digest,
            moments=self._moments,
            source_files={road_map.FILE: read_map(archive).to_json()},
        )

    @property
    def _images(self) -> list[Path]:
        """The files that cameras are made of."""
        images = [path for pair in self.pairs for path in (pair.left, pair.right)]
        images += [path for ring in self.rings.values() for path in ring.values()]
        return [*calibration_files(self.folder), *images] if images else []

    @property
    def _boxes(self) -> Path:
        return self.folder / "annotations.feather"

    @property
    def _poses(self) -> Path:
        return self.folder / "city_SE3_egovehicle.feather"

    def _moments(self) -> Iterator[Moment]:
        boxes = read_boxes(self._boxes)
        stamps_ns = self._times_ns(boxes)
        places = read_poses(self._poses, stamps_ns)
        actors = actors_of(boxes, places, self._boxes)
        poses = [planar(stamp_ns, places[stamp_ns]) for stamp_ns in stamps_ns]
        frames = self._frames(stamps_ns)
        motion = dict(zip(stamps_ns, zip(poses, motion_of(poses), strict=True), strict=True))
        for now_ns in sorted({*motion, *frames}):
            cameras = {name: make() for name, make in frames.get(now_ns, {}).items()}
            if now_ns in motion:
                pose, sample = motion[now_ns]
                yield Moment(now_ns, cameras, (sample,), pose, actors[now_ns], self._seen(now_ns))
            else:
                yield Moment(now_ns, cameras)

    def _times_ns(self, boxes: Table) -> list[int]:
        """Return the times of boxes, which are those of motion."""
        found: list[int] = np.unique(boxes["timestamp_ns"]).tolist()
        if len(found) < 2:
            raise InputError("has boxes of a single time; motion needs more", path=self._boxes)
        return found

    def _looks(self, times_ns: list[int]) -> dict[str, Look]:
        """Return what cameras see while motion is known; those that see nothing then are left out."""
        first_ns, last_ns = times_ns[0], times_ns[-1]
        pairs = [pair for pair in self.pairs if first_ns <= pair.stamp_ns <= last_ns]
        rings = {
            name: {stamp_ns: path for stamp_ns, path in images.items() if first_ns <= stamp_ns <= last_ns}
            for name, images in self.rings.items()
        }
        found = {CAMERA: stereo_look(self.folder, pairs)} if pairs else {}
        return found | {name: ring_look(self.folder, name, images) for name, images in rings.items() if images}

    def _frames(self, times_ns: list[int]) -> dict[int, dict[str, Callable[[], CameraFrame]]]:
        """Return what makes frames, by time and camera."""
        found: dict[int, dict[str, Callable[[], CameraFrame]]] = defaultdict(dict)
        for name, look in self._looks(times_ns).items():
            for stamp_ns, make in look.frames.items():
                found[stamp_ns][name] = make
        return found

    def _seen(self, now_ns: int) -> dict[str, LidarSweep]:
        return {LIDAR: _sweep(now_ns, self.sweeps[now_ns])} if now_ns in self.sweeps else {}


def _sweep(stamp_ns: int, path: Path) -> LidarSweep:
    table = read_table(path, _POINTS)
    points_m = np.stack([table[name] for name in "xyz"], axis=1).astype(np.float32)
    with located(path=path):
        return LidarSweep(stamp_ns, _IN_VEHICLE, points_m, table["intensity"].astype(np.float32), None)
