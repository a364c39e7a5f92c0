"""Keeps small pictures of the frames that a run's windows use, and the track; what a log cannot give is left out."""

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from semgrid_eval.errors import InputError, LogError, ResultError, SemgridError
from semgrid_eval.executors import Executor
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import label_palette
from semgrid_eval.log import topics
from semgrid_eval.log.container import damage_as_log_error
from semgrid_eval.log.reader import LogReader
from semgrid_eval.motion import Integrator
from semgrid_eval.progress import Stage
from semgrid_eval.recording.colour import decode_colour
from semgrid_eval.recording.png import decode_ids, encode_gray, read_header, with_palette
from semgrid_eval.scores.thumbnails import (
    FramePictures,
    LogPictures,
    Track,
    pictures_file,
    read_pictures,
    write_pictures,
)
from semgrid_eval.sensors.camera import CameraSensor, frame_poses
from semgrid_eval.sensors.projection import nearest_indices, unit_projection

if TYPE_CHECKING:  # processes that only shrink pictures need no torch
    from semgrid_eval.windows.data import WindowSet

_log = logging.getLogger(__name__)
_NO_TRACK = Track(0, np.empty(0, np.int64), np.empty((0, 3)), np.empty((3, 4)))
WIDTH_PX = 256
WEBP_QUALITY = 75


class Request(NamedTuple):
    """The frames of a log whose pictures are to lie in `file`; the camera is the one that leads the grids' target."""

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

    Raises:
        LogError: the log cannot be read, is damaged, or has another digest, or no camera leads the target.
    """
    wanted, faults = set(stamps_ns), list[str]()
    found: dict[int, dict[str, bytes]] = {stamp: {} for stamp in wanted}
    with LogReader(log) as reader:
        if reader.digest != digest:
            raise LogError(f"has digest {reader.digest}, not {digest}", path=log)
        if grid.camera is None:
            raise LogError(f"{grid.target[0]!r} is not a camera", path=log)
        name = reader.choose_camera(grid.camera.camera)
        track = _track(reader, grid.camera, grid.integrator)
        for stamp_ns, _, channel, png in reader.pictures([name], _SHRINK):
            if stamp_ns > max(wanted, default=-1):
                break
            if stamp_ns in wanted:
                try:
                    found[stamp_ns][channel] = _SHRINK[channel](png)
                except InputError as error:
                    faults.append(f"{log.stem}: {channel} at {stamp_ns} ns {error}")
    frames = {stamp: FramePictures(**files) for stamp, files in found.items()}
    return LogPictures(track, frames, tuple(faults))


def small_image(file: bytes) -> bytes:
    """Turn a colour image, a PNG or JPEG file, into a small WebP file; an InputError says that it cannot be decoded."""
    image = decode_colour(file)
    small = cv2.resize(image, _small_size(*image.shape[:2])[::-1], interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".webp", small[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, WEBP_QUALITY])
    return bytes(data)


def small_label(png: bytes) -> bytes:
    """Turn a label image, a PNG file of label ids, into a small one with their colours; errors as `small_image`."""
    ids = decode_ids(png)
    height, width = _small_size(*ids.shape)
    small = ids[nearest_indices(ids.shape[0], height)[:, None], nearest_indices(ids.shape[1], width)[None, :]]
    return with_palette(encode_gray(small), label_palette()[: int(small.max()) + 1])


_SHRINK = {topics.IMAGE: small_image, topics.LABEL: small_label}


def _small_size(height: int, width: int) -> tuple[int, int]:
    """Height and width of a picture that is no wider than `WIDTH_PX`."""
    return (height, width) if width <= WIDTH_PX else (max(1, round(WIDTH_PX * height / width)), WIDTH_PX)


def _track(reader: LogReader, sensor: CameraSensor, integrator: Integrator) -> Track:
    poses, camera = frame_poses(reader, sensor, integrator), reader.choose_camera(sensor.camera)
    first = next(reader.pictures([camera], [topics.DISPARITY]))
    with damage_as_log_error(reader.path):
        header = read_header(first.png)
    return Track(
        start_ns=reader.start_ns,
        stamps_ns=np.array([pose.stamp_ns for pose in poses], np.int64),
        poses=np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses], np.float64),
        projection=unit_projection(reader.calibration(camera), (header.width, header.height)),
    )


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
