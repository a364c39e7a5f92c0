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
from semgrid_eval.sources.argoverse2.ring import OPTION as RING
from semgrid_eval.sources.argoverse2.ring import ring_look
from semgrid_eval.sources.argoverse2.stereo import CAMERA, stereo_look
from semgrid_eval.sources.argoverse2.stereo import OPTION as STEREO
from semgrid_eval.sources.argoverse2.tables import MAX_FILE_BYTES, read_table
from semgrid_eval.sources.argoverse2.taken import Every, Span, Taken, take
from semgrid_eval.sources.argoverse2.tracks import actors_of, read_boxes, read_poses
from semgrid_eval.sources.argoverse2.vehicle import EGO_FROM_ARGOVERSE
from semgrid_eval.sources.poses import motion_of, planar

DATASET = "argoverse2"
LIDAR = "top"
"""Name in logs of the two scanners on the roof, whose sweeps come as one."""
_IN_VEHICLE = Mount.of(EGO_FROM_ARGOVERSE)  # where Argoverse gives the points of a sweep
_POINTS = {**dict.fromkeys(("x", "y", "z"), "float64"), "intensity": "float64"}
_CONVERSION_VERSION = 3  # to be raised when the same files give another recording


@dataclass(frozen=True)
class Drive:
    """The folder of a log, which is its name; faults are InputErrors that name a file."""

    folder: Path
    split: str
    every: Every

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.folder.name

    @cached_property
    def sweeps(self) -> dict[int, Path]:
        """The files of the LiDAR's sweeps by time."""
        return stamped(self.folder / "sensors" / "lidar", "*.feather")

    @cached_property
    def times_ns(self) -> list[int]:
        """The times of boxes, which are those of motion."""
        found: list[int] = np.unique(read_boxes(self._boxes)["timestamp_ns"]).tolist()
        if len(found) < 2:
            raise InputError("has boxes of a single time; motion needs more", path=self._boxes)
        return found

    @cached_property
    def taken(self) -> Taken:
        """The images that cameras are made of; an InputError says that there are stereo images, but no pair."""
        return take(self.folder, self.every, Span(self.times_ns[0], self.times_ns[-1]))

    def digest(self) -> str:
        """Digest the bytes of all files that are used."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        used = [self._boxes, self._poses, find_archive(self.folder), *self.sweeps.values()]
        for path in used:
            if not path.is_file():
                raise InputError("is missing", path=path)
        used += [*self._calibration(), *self.taken.files]
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
            calibrations={name: look.calibration for name, look in self._looks().items()},
            source_digest=self._digest,
            moments=self._moments,
            source_files={road_map.FILE: read_map(archive).to_json()},
        )

    def _calibration(self) -> tuple[Path, ...]:
        """Return the files that say how cameras see, where there are some."""
        chosen = {STEREO: self.taken.pairs, RING: self.taken.rings}
        options = " ".join(f"{option} 0" for option, images in chosen.items() if images)
        found = calibration_files(self.folder) if options else ()
        for path in found:
            if not path.is_file():
                raise InputError(f"is missing ({options} leaves images out)", path=path)
        return found

    @property
    def _boxes(self) -> Path:
        return self.folder / "annotations.feather"

    @property
    def _poses(self) -> Path:
        return self.folder / "city_SE3_egovehicle.feather"

    def _moments(self) -> Iterator[Moment]:
        places = read_poses(self._poses, self.times_ns)
        actors = actors_of(read_boxes(self._boxes), places, self._boxes)
        poses = [planar(stamp_ns, places[stamp_ns]) for stamp_ns in self.times_ns]
        frames = self._frames()
        motion = dict(zip(self.times_ns, zip(poses, motion_of(poses), strict=True), strict=True))
        for now_ns in sorted({*motion, *frames}):
            cameras = {name: make() for name, make in frames.get(now_ns, {}).items()}
            if now_ns in motion:
                pose, sample = motion[now_ns]
                yield Moment(now_ns, cameras, (sample,), pose, actors[now_ns], self._seen(now_ns))
            else:
                yield Moment(now_ns, cameras)

    def _looks(self) -> dict[str, Look]:
        """Return what cameras see."""
        pairs, rings = self.taken.pairs, self.taken.rings
        found = {CAMERA: stereo_look(self.folder, pairs)} if pairs else {}
        return found | {name: ring_look(self.folder, name, images) for name, images in rings.items()}

    def _frames(self) -> dict[int, dict[str, Callable[[], CameraFrame]]]:
        """Return what makes frames, by time and camera."""
        found: dict[int, dict[str, Callable[[], CameraFrame]]] = defaultdict(dict)
        for name, look in self._looks().items():
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
