"""Write recordings as MCAP logs, find logs, and open them."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.files import atomic_file, require_file_name
from semgrid_eval.log.codec import CONDITIONS_RECORD, RECORD, Scene, conditions_metadata
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.writer import MessageWriter, MomentWriter
from semgrid_eval.recording.types import Moment, Recording

SUFFIX = ".mcap"


def find_logs(folder: Path) -> list[Path]:
    """List all logs below a folder, linked folders included, sorted by path; hidden files are left out.

    Raises:
        InputError: the folder does not exist or holds no log.
    """
    found = sorted(_walk(folder, {folder.resolve()}))
    if not found:
        raise InputError("holds no .mcap log" if folder.is_dir() else "is not a folder", path=folder)
    return found


def label_of(log: Path, folder: Path) -> str:
    """Return what a conversion into a folder calls a log of it: its split and name, its path without the ending."""
    return log.relative_to(folder).with_suffix("").as_posix()


def _walk(folder: Path, seen: set[Path]) -> Iterator[Path]:
    """Find logs in a folder and those below it, each folder once, however links lead to it."""
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.is_dir():
            if path.resolve() not in seen:
                seen.add(path.resolve())
                yield from _walk(path, seen)
        elif path.suffix == SUFFIX and not path.name.startswith("."):
            yield path


def write_log(recording: Recording, path: Path) -> None:
    """Write a recording to `path`, moment by moment; an error leaves nothing behind.

    Raises:
        InputError: the source is at fault, its moments are not in the order of time, or the file cannot be written.
    """
    same = {name: getattr(recording, name) for name in ("name", "dataset", "split", "source_digest", "group")}
    scene = Scene(**same, cameras=tuple(sorted(recording.calibrations)))
    try:
        for what in ("name", "split"):
            require_file_name(getattr(scene, what), what)
    except ValueError as error:
        raise InputError(str(error), field="recording") from error
    with atomic_file(path) as stream, MessageWriter(stream) as writer:
        writer.metadata(RECORD, scene.to_metadata())
        if recording.conditions:
            writer.metadata(CONDITIONS_RECORD, conditions_metadata(recording.conditions))
        for name, data in sorted(recording.source_files.items()):
            media_type = "application/json" if name.endswith(".json") else "application/octet-stream"
            writer.attach(name, media_type, data)
        MomentWriter(writer, recording).write()


def read_recording(path: Path) -> Recording:
    """Return what a log holds as a recording; written again, it makes the same bytes.

    Each pass over its moments opens the log and streams from it. Motion after the last moment is left out.

    Raises:
        LogError: the file cannot be read or is damaged; what is found only while streaming is raised then.
    """
    with LogReader(path) as log:
        return Recording(
            name=log.scene.name,
            dataset=log.scene.dataset,
            split=log.scene.split,
            group=log.scene.group,
            calibrations={camera: log.calibration(camera) for camera in log.scene.cameras},
            source_digest=log.scene.source_digest,
            moments=partial(_moments, path),
            source_files=log.attachments(),
            conditions=log.conditions(),
        )


def _moments(path: Path) -> Iterator[Moment]:
    with LogReader(path) as log:
        yield from log.moments()
