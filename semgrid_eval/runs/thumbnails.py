"""Keeps small pictures of the frames that a run's windows use, and the drive; what a log cannot give is left out."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from semgrid_eval.classes import label_palette
from semgrid_eval.errors import InputError, LogError, ResultError, SemgridError
from semgrid_eval.executors import Executor
from semgrid_eval.grids.geometry import nearest_indices, unit_projection
from semgrid_eval.log import topics
from semgrid_eval.log.container import damage_as_log_error
from semgrid_eval.log.store import LogReader
from semgrid_eval.playback.drive import drive_poses
from semgrid_eval.progress import Stage
from semgrid_eval.recording.png import decode_colour, decode_ids, encode_gray, read_header, with_palette
from semgrid_eval.scores.thumbnails import (
    Drive,
    FramePictures,
    LogPictures,
    pictures_file,
    read_pictures,
    write_pictures,
)

if TYPE_CHECKING:  # processes that only shrink pictures need no torch
    from semgrid_eval.windows.data import WindowSet

WIDTH_PX = 256
WEBP_QUALITY = 75


class Request(NamedTuple):
    """The frames of one camera of one log whose pictures are to lie in `file`."""

    log: Path
    digest: str
    camera: str | None
    stamps_ns: frozenset[int]
    file: Path


def keep_pictures(
    run: Path, windows: Iterable[tuple["WindowSet", str | None]], executor: Executor, stage: Stage
) -> None:
    """Make sure that the pictures of all frames of windows lie in the run's folder, as far as the logs have them.

    Logs that are gone, damaged or not what they were give none: a run needs no pictures.

    Args:
        run: folder of the run.
        windows: sets of windows, each with the camera of its grids.
        executor: works on several logs at once.
        stage: shows progress.

    Raises:
        InputError: the folder cannot be written to.
    """
    missing = [request for request in _requests(run, windows) if not request.stamps_ns <= _kept(request.file).keys()]
    if not missing:
        return
    with stage("pictures") as progress:
        for done, (index, failure) in enumerate(executor.run(_keep, missing), start=1):
            if isinstance(failure, InputError):
                raise failure
            progress(done, len(missing), missing[index].log.stem)


def log_pictures(log: Path, digest: str, camera: str | None, stamps_ns: Iterable[int]) -> LogPictures:
    """Read the drive of a log and make small pictures of some of its frames; what it does not have stays empty.

    Raises:
        LogError: the log cannot be read, is damaged, or has another digest.
    """
    wanted = set(stamps_ns)
    found: dict[int, dict[str, bytes]] = {stamp: {} for stamp in wanted}
    with LogReader(log) as reader:
        if reader.digest != digest:
            raise LogError(f"has digest {reader.digest}, not {digest}", path=log)
        name = reader.choose_camera(camera)
        drive = _drive(reader, name)
        for stamp_ns, _, channel, png in reader.pictures([name], _SHRINK):
            if stamp_ns > max(wanted, default=-1):
                break
            if stamp_ns in wanted:
                found[stamp_ns][channel] = _SHRINK[channel](png)
    return LogPictures(drive, {stamp: FramePictures(**files) for stamp, files in found.items()})


def small_image(png: bytes) -> bytes:
    """Turn a colour image, a PNG file, into a small WebP file; empty where it cannot be decoded."""
    try:
        image = decode_colour(png)
    except InputError:
        return b""
    small = cv2.resize(image, _small_size(*image.shape[:2])[::-1], interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".webp", small[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, WEBP_QUALITY])
    return bytes(data)


def small_label(png: bytes) -> bytes:
    """Turn a label image, a PNG file of label ids, into a small one with their colours; empty as `small_image`."""
    try:
        ids = decode_ids(png)
    except InputError:
        return b""
    height, width = _small_size(*ids.shape)
    small = ids[nearest_indices(ids.shape[0], height)[:, None], nearest_indices(ids.shape[1], width)[None, :]]
    return with_palette(encode_gray(small), label_palette()[: int(small.max()) + 1])


_SHRINK = {topics.IMAGE: small_image, topics.LABEL: small_label}


def _small_size(height: int, width: int) -> tuple[int, int]:
    """Height and width of a picture that is no wider than `WIDTH_PX`."""
    return (height, width) if width <= WIDTH_PX else (max(1, round(WIDTH_PX * height / width)), WIDTH_PX)


def _drive(reader: LogReader, camera: str) -> Drive:
    poses = drive_poses(reader, camera)
    first = next(reader.pictures([camera], [topics.DISPARITY]))
    with damage_as_log_error(reader.path):
        header = read_header(first.png)
    return Drive(
        start_ns=reader.start_ns,
        track_ns=np.array([pose.stamp_ns for pose in poses], np.int64),
        track=np.array([(pose.x_m, pose.y_m, pose.yaw_rad) for pose in poses], np.float64),
        projection=unit_projection(reader.calibration(camera), (header.width, header.height)),
    )


def _requests(run: Path, windows: Iterable[tuple["WindowSet", str | None]]) -> list[Request]:
    """Gather the frames of all windows by log and camera; rows share most of them.

    Paths are absolute, since the executor's processes may stand elsewhere.
    """
    logs: dict[Path, Request] = {}
    for chosen, camera in windows:
        data = chosen.data
        frames = np.unique(np.append(chosen.inputs.cpu().numpy(), chosen.target_frames.cpu().numpy()))
        owners, begins = np.unique(data.locate(frames)[0], return_index=True)
        for owner, own in zip(owners.tolist(), np.split(frames, begins[1:]), strict=True):
            stamps_ns = frozenset(data.stamps_ns[own].tolist())
            file = pictures_file(run.resolve(), data.digests[owner], camera)
            known = logs[file].stamps_ns if file in logs else frozenset()
            logs[file] = Request(Path(data.logs[owner]).resolve(), data.digests[owner], camera, known | stamps_ns, file)
    return list(logs.values())


def _keep(request: Request) -> InputError | None:
    """Add what is missing to a log's pictures, or return why that cannot be written."""
    kept = _kept(request.file)
    try:
        made = log_pictures(request.log, request.digest, request.camera, request.stamps_ns - kept.keys())
    except SemgridError:
        return None
    try:
        write_pictures(request.file, LogPictures(made.drive, {**kept, **made.frames}))
    except InputError as error:
        return error
    return None


def _kept(file: Path) -> Mapping[int, FramePictures]:
    try:
        return read_pictures(file).frames
    except ResultError:  # not made yet, or damaged
        return {}
