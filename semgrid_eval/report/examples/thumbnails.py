"""What a run kept of the logs behind its windows, and what the camera saw of one: its image and the ground in view."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, ResultError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.examples.drawing import Picture, data_uri, hatch_png, label_picture
from semgrid_eval.report.page.provenance import play_command
from semgrid_eval.report.rows.load import Result, Row, Run
from semgrid_eval.scores.results import WindowRecord, scored_digest
from semgrid_eval.scores.thumbnails import LogPictures, Track, pictures_file, read_pictures, read_track
from semgrid_eval.sensors.camera import CameraSensor

_EPOCH_FROM_NS = 10**17  # stamps beyond 1973 are dates, smaller ones are times since the start of a log
_LOGS_KEPT = 64  # in memory
T = TypeVar("T")


class RunThumbnails:
    """What one run kept of its logs."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._read = lru_cache(_LOGS_KEPT)(partial(self._kept, read_pictures))
        self._read_track = cache(partial(self._kept, read_track))
        self._files: dict[tuple[str, Path], Path | None] = {}

    def of(self, log: str, result: Result) -> LogPictures | None:
        """Return what was kept of a log that a result is scored on, None where that is nothing that can be read."""
        return self._read(self._file(log, result))

    def track(self, log: str, result: Result) -> Track | None:
        """Return the track of such a log alone; all that are asked for stay in memory."""
        return self._read_track(self._file(log, result))

    def command(self, row: Row, window: WindowRecord) -> str:
        """Write the command that plays a window's recording."""
        return play_command(self._run.record.command, row.record.name, window.recording)

    def _file(self, log: str, result: Result) -> Path | None:
        asked = (log, result.folder)
        if asked not in self._files:
            digest = scored_digest(self._run.record, result.record, log)
            file = None if digest is None else pictures_file(self._run.folder, digest, result.grid or GridConfig())
            self._files[asked] = file
        return self._files[asked]

    @staticmethod
    def _kept(read: Callable[[Path], T], file: Path | None) -> T | None:
        with suppress(ResultError):
            return None if file is None else read(file)
        return None


def times(stamp_ns: int, kept: LogPictures | None) -> tuple[str, ...]:
    """Write a time in the forms that viewers take: nanoseconds, seconds, since the log's start, and as a date."""
    seconds = f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"
    since = () if kept is None else (f"{(stamp_ns - kept.track.start_ns) / 1e9:.3f} s into the log",)
    date = f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S}.{stamp_ns % 10**9 // 10**6:03d} UTC"
    return (f"{stamp_ns} ns", f"{seconds} s", *since, *((date,) if stamp_ns >= _EPOCH_FROM_NS else ()))


@dataclass(frozen=True)
class Crop:
    """A sensor's part of the camera image, in percent of its width and height."""

    name: str
    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True)
class View:
    """What is known of a window besides its grids."""

    window: WindowRecord
    kept: LogPictures | None  # of its log; None where that is nothing
    grid: GridConfig | None  # how its grids were made; None where the result does not tell
    sensors: tuple[str, ...]  # names of those of the inputs

    def photos(self, stamp_ns: int, moment: str) -> Iterator[Picture]:
        """Return the camera image and the segmentation of a time, or a LiDAR's points, as far as they were kept."""
        if self.kept is None or self.grid is None or stamp_ns not in self.kept.frames:
            return
        files = self.kept.frames[stamp_ns]
        if files.image:
            yield Picture("Camera", f"Camera image, {moment}", data_uri(files.image, "image/webp"), kind="camera")
        with suppress(InputError):  # there is none, or it is damaged
            title = "Segmentation" if self.kept.track.has_camera else "Points, all around"
            yield label_picture((title, f"{title}, {moment}"), files.label, self.grid)

    def before(self, stamp_ns: int) -> str:
        """Tell how long before the target a time is."""
        return f"{(self.window.target_stamp_ns - stamp_ns) / 1e9:.3f} s before the target"

    @property
    def crops(self) -> tuple[Crop, ...]:
        """The parts of the shown image that the sensors see, none for the whole image."""
        if self.grid is None:
            return ()
        parts = parts_of_shown(self.grid)
        seen = (name for name in self.sensors if name in parts and not parts[name].is_whole_image)
        return tuple(_crop(name, parts[name]) for name in seen)

    @property
    def hatching(self) -> str:
        """A picture to lay over grids that marks the ground that no sensor of an input sees; empty if there is none."""
        if self.kept is None or self.grid is None:
            return ""
        cells = blind_cells(self.kept.track, self.grid, self.sensors, self.window)
        return data_uri(hatch_png(cells)) if cells is not None and cells.any() else ""


def _crop(name: str, part: CameraSensor) -> Crop:
    width, height = part.image_size_px
    top, bottom, left, right = part.crop_px
    across, down = 100 / width, 100 / height
    return Crop(name, left * across, top * down, (right - left) * across, (bottom - top) * down)


def blind_cells(
    track: Track, grid: GridConfig, sensors: Sequence[str], window: WindowRecord
) -> NDArray[np.bool_] | None:
    """Flag the blind cells of a window in the target's place: (H, W).

    The ground is taken as flat, so this says where ground is seen, not how far walls and cars reach into view. None
    where an input sensor is not a part of the shown camera's image, or inputs have other times than frames.
    """
    parts = parts_of_shown(grid)
    place = {int(stamp): frame for frame, stamp in enumerate(track.stamps_ns)}
    stamps = (window.target_stamp_ns, *window.input_stamps_ns)
    if not all(stamp in place for stamp in stamps) or not all(name in parts for name in sensors):
        return None
    target, *inputs = (place[stamp] for stamp in stamps)
    first = max(0, target - window.target_frame)  # of the stretch whose orientation the grids have
    poses = [SE2(*pose) for pose in track.poses.tolist()]
    grid_pose = SE2(poses[target].x_m, poses[target].y_m, poses[first].yaw_rad)
    ground_m = grid_pose.apply(np.stack(np.meshgrid(*grid.spec.centres_m(), indexing="ij"), axis=-1))  # (H, W, 2)
    seen, covered = np.zeros(ground_m.shape[:2], np.bool_), np.zeros(ground_m.shape[:2], np.bool_)
    for frame in inputs:
        u, v = _image_places(track.projection, poses[frame].inverse().apply(ground_m))
        seen |= (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
        for part in (parts[name] for name in sensors):
            (width, height), (top, bottom, left, right) = part.image_size_px, part.crop_px
            covered |= (u * width >= left) & (u * width < right) & (v * height >= top) & (v * height < bottom)
    return seen & ~covered


def parts_of_shown(grid: GridConfig) -> dict[str, CameraSensor]:
    """Return the sensors that are parts of the image of the camera that leads the target, which a run keeps."""
    cameras = {name: sensor for name, sensor in grid.sensors.items() if isinstance(sensor, CameraSensor)}
    return {name: sensor for name, sensor in cameras.items() if grid.camera and sensor.shares_image_with(grid.camera)}


def _image_places(
    projection: NDArray[np.float64], ego_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Project points of the ground (H, W, 2) to the image, u and v (H, W) from 0 to 1; NaN behind the camera."""
    across, down, depth_m = np.moveaxis(ego_m @ projection[:, :2].T + projection[:, 3], -1, 0)
    depth_m = np.where(depth_m > 0, depth_m, np.nan)
    return across / depth_m, down / depth_m
