"""Keeps small pictures of the frames that a run's windows use, and the track; what a log cannot give is left out."""

import logging
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, LogError, ResultError, SemgridError
from semgrid_eval.executors import Executor
from semgrid_eval.grids.shown import frame_poses, shown_camera, shown_lidar
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import label_palette
from semgrid_eval.log import topics
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import camera_topic
from semgrid_eval.progress import Stage
from semgrid_eval.recording.colour import decode_colour
from semgrid_eval.recording.panorama import panorama_png
from semgrid_eval.recording.png import decode_ids, encode_gray, with_palette
from semgrid_eval.recording.resizing import nearest
from semgrid_eval.scores.thumbnails import (
    FramePictures,
    LogPictures,
    Track,
    pictures_file,
    read_pictures,
    write_pictures,
)
from semgrid_eval.sensors.projection import unit_projection

if TYPE_CHECKING:  # processes that only shrink pictures need no torch
    from semgrid_eval.windows.data import WindowSet

_log = logging.getLogger(__name__)
_NO_TRACK = Track(0, np.empty(0, np.int64), np.empty((0, 3)), np.empty((3, 4)))
_REACH_NS = 100_000_000
"""How far from a frame a picture may be that is not of that frame."""
WIDTH_PX = 256
WEBP_QUALITY = 75


class Request(NamedTuple):
    """The frames of a log whose pictures are to lie in `file`: times of the sensor that leads the grids' target."""

    log: Path
    digest: str
    grid: GridConfig
    stamps_ns: frozenset[int]
    file: Path


def keep_pictures(
    run: Path, windows: Iterable[tuple["WindowSet", GridConfig]], executor: Executor, stage: Stage
) -> None:
    """Make sure that the pictures of all frames of windows lie in the run's folder, as far as the logs have them.

    Logs that are gone, damaged or not what they were give none: a run needs no pictures. Windows come with how their
    grids were made.

    Raises:
        InputError: the folder cannot be written to.
    """
    found = _requests(run, windows)
    missing = [each for each in found if not each.stamps_ns <= _kept(each.file, tell=True).frames.keys()]
    if not missing:
        return
    with stage("pictures") as progress:
        for done, (index, failure) in enumerate(executor.run(_keep, missing), start=1):
            if isinstance(failure, InputError):
                raise failure
            progress(done, len(missing), missing[index].log.stem)


def log_pictures(log: Path, digest: str, grid: GridConfig, stamps_ns: Iterable[int]) -> LogPictures:
    """Read the track of a log and make small pictures of some of its frames; what it does not have stays empty.

    They are a camera's: of the frame itself where a camera leads the target, else those nearest in time. Without a
    camera they are what the LiDAR that leads it saw all around.

    Raises:
        LogError: the log cannot be read, is damaged, or has another digest, or no such sensor.
    """
    with LogReader(log) as reader:
        if reader.digest != digest:
            raise LogError(f"has digest {reader.digest}, not {digest}", path=log)
        camera, lidar = shown_camera(reader, grid), shown_lidar(reader, grid)
        album = _Album(reader, stamps_ns)
        if camera is not None:
            album.add_photos(camera, reach_ns=0 if grid.camera else _REACH_NS)
        elif lidar is not None:
            album.add_panoramas(lidar)
        return LogPictures(_track(reader, grid, camera), album.frames(), tuple(album.faults))


class _Album:
    """Gathers the small pictures of some frames of a log."""

    def __init__(self, log: LogReader, stamps_ns: Iterable[int]) -> None:
        self.faults: list[str] = []
        self._log, self._stamps_ns = log, np.array(sorted(set(stamps_ns)), np.int64)
        self._found: dict[int, dict[str, bytes]] = {stamp: {} for stamp in self._stamps_ns.tolist()}

    def frames(self) -> dict[int, FramePictures]:
        return {stamp: FramePictures(**files) for stamp, files in self._found.items()}

    def add_photos(self, camera: str, *, reach_ns: int) -> None:
        """Add the pictures of a camera that are nearest to the frames, at most so far from them."""
        uses = {channel: self._uses(camera_topic(camera, channel), reach_ns) for channel in _SHRINK}
        last_ns = max((stamp for used in uses.values() for stamp in used), default=-1)
        for stamp_ns, _, channel, png in self._log.pictures([camera], _SHRINK):
            if stamp_ns > last_ns:
                break
            if stamp_ns in uses[channel]:
                self._add(channel, png, stamp_ns, uses[channel][stamp_ns])

    def add_panoramas(self, lidar: str) -> None:
        """Add what a LiDAR saw whose sweeps are the frames, as far as its points have labels."""
        for sweep in self._log.sweeps(lidar):
            if sweep.stamp_ns in self._found and sweep.label_id is not None:
                self._found[sweep.stamp_ns][topics.LABEL] = panorama_png(sweep)

    def _uses(self, topic: str, reach_ns: int) -> dict[int, list[int]]:
        """Return the times of the messages of a topic that are wanted, each with the frames that it is for."""
        if not reach_ns:
            return {stamp: [stamp] for stamp in self._stamps_ns.tolist()}
        there = np.array([stamp for _, stamp, _, _ in self._log.messages([topic])], np.int64)
        uses: dict[int, list[int]] = {}
        for stamp in self._stamps_ns.tolist() if len(there) else ():
            nearest = int(there[np.abs(there - stamp).argmin()])  # the earlier of two
            if abs(nearest - stamp) <= reach_ns:
                uses.setdefault(nearest, []).append(stamp)
        return uses

    def _add(self, channel: str, png: bytes, stamp_ns: int, frames: Sequence[int]) -> None:
        try:
            small = _SHRINK[channel](png)
        except InputError as error:
            self.faults.append(f"{self._log.path.stem}: {channel} at {stamp_ns} ns {error}")
            return
        for frame in frames:
            self._found[frame][channel] = small


def small_image(file: bytes) -> bytes:
    """Turn a colour image, a PNG or JPEG file, into a small WebP file; an InputError says that it cannot be decoded."""
    image = decode_colour(file)
    small = cv2.resize(image, _small_size(*image.shape[:2])[::-1], interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".webp", small[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, WEBP_QUALITY])
    return bytes(data)


def small_label(png: bytes) -> bytes:
    """Turn a label image, a PNG file of label ids, into a small one with their colours; errors as `small_image`."""
    ids = decode_ids(png)
    small = nearest(ids, _small_size(*ids.shape)[::-1])
    return with_palette(encode_gray(small), label_palette()[: int(small.max()) + 1])


_SHRINK = {topics.IMAGE: small_image, topics.LABEL: small_label}


def _small_size(height: int, width: int) -> tuple[int, int]:
    """Height and width of a picture that is no wider than `WIDTH_PX`."""
    return (height, width) if width <= WIDTH_PX else (max(1, round(WIDTH_PX * height / width)), WIDTH_PX)


def _track(reader: LogReader, grid: GridConfig, camera: str | None) -> Track:
    poses = frame_poses(reader, grid)
    return Track(
        start_ns=reader.start_ns,
        stamps_ns=np.array([pose.stamp_ns for pose in poses], np.int64),
        poses=np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses], np.float64).reshape(-1, 3),
        projection=_projection(reader, camera),
    )


def _projection(reader: LogReader, camera: str | None) -> NDArray[np.float64]:
    if camera is None:
        return np.zeros((3, 4))
    return unit_projection(reader.calibration(camera), reader.image_size(camera))


def _requests(run: Path, windows: Iterable[tuple["WindowSet", GridConfig]]) -> list[Request]:
    """Gather the frames of all windows by log and camera; rows share most of them.

    Paths are absolute, since the executor's processes may stand elsewhere.
    """
    logs: dict[Path, Request] = {}
    for chosen, grid in windows:
        data = chosen.data
        frames = np.unique(np.append(chosen.inputs.cpu().numpy(), chosen.target_frames.cpu().numpy()))
        owners, begins = np.unique(data.locate(frames)[0], return_index=True)
        for owner, own in zip(owners.tolist(), np.split(frames, begins[1:]), strict=True):
            stamps_ns = frozenset(data.stamps_ns[own].tolist())
            file = pictures_file(run.resolve(), data.digests[owner], grid)
            known = logs[file].stamps_ns if file in logs else frozenset()
            logs[file] = Request(Path(data.logs[owner]).resolve(), data.digests[owner], grid, known | stamps_ns, file)
    return list(logs.values())


def _keep(request: Request) -> InputError | None:
    """Add what is missing to a log's pictures, or return why that cannot be written."""
    kept = _kept(request.file)
    try:
        made = log_pictures(request.log, request.digest, request.grid, request.stamps_ns - kept.frames.keys())
    except SemgridError as error:
        _log.warning("%s; there are no pictures of it", error)
        return None
    try:
        both = LogPictures(made.track, {**kept.frames, **made.frames}, kept.faults + made.faults)
        write_pictures(request.file, both)
    except InputError as error:
        return error
    return None


def _kept(file: Path, *, tell: bool = False) -> LogPictures:
    try:
        return read_pictures(file)
    except ResultError as error:  # not made yet, or damaged
        if tell and file.exists():
            _log.warning("%s; the pictures are made again", error)
        return LogPictures(_NO_TRACK)
