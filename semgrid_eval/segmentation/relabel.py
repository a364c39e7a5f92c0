"""New logs of old ones, with the label images that a segmentation network gives for their colour images."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from glob import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import InputError, LogError
from semgrid_eval.files import digest_files, digest_value
from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, read_recording
from semgrid_eval.recording.colour import decode_colour
from semgrid_eval.recording.png import encode_gray
from semgrid_eval.recording.types import CameraFrame, Moment, Recording
from semgrid_eval.segmentation.class_maps import ClassMap
from semgrid_eval.segmentation.config import SegmentationConfig
from semgrid_eval.segmentation.network import SegmentationNetwork

RECORD = "segmentation.json"
"""The attachment that says what made the labels."""
_METHOD_VERSION = 1
Labeller = Callable[[NDArray[np.uint8]], NDArray[np.uint8]]


def segment_logs(
    logs: Sequence[Path],
    model: Path,
    config: SegmentationConfig,
    out: Path,
    work: Work = IN_PROCESS,
    *,
    device: str = "auto",
) -> ConversionSummary:
    """Write the log OUT/<split>/<name>.mcap for each log: all it holds, its label images made by a network.

    A log that is whole and was made from the same log, model and config on the same kind of device is left as it is.
    One that fails is named in the summary with its reason. `logs` are files, and folders of which all logs are taken;
    `model` is the ONNX file, and files beside it whose names begin with its name (its weights) count as part of it;
    `device` is as `open_model` says, and the summary's remark tells which it was.

    Raises:
        MissingExtraError: ONNX Runtime is not installed.
        ConfigError: there is no such device or class map.
        InputError: the model cannot be used, a folder holds no log, two logs have one name, or `out` would mix the new
            logs with the old.
    """
    _refuse_mixing(logs, out)
    paths = [path for given in logs for path in (find_logs(given) if given.is_dir() else [given])]
    network = SegmentationNetwork(model, config, device=device)  # one that cannot be used is one error, not one a log
    parts = sorted(path for path in model.parent.glob(f"{escape(model.name)}*") if path.is_file())
    recipe = _Recipe(model, digest_files(parts), config, network.class_map, network.device)
    summary = convert_jobs([_job(path, recipe) for path in paths], out, work, label="segment")
    if summary.written or summary.skipped:
        summary.remark = f"labels: {model.name} on {network.device}, its classes by the map {network.class_map.name}"
    return summary


def _relabelled(recording: Recording, label: Labeller) -> Iterator[Moment]:
    """Iterate over moments whose label images are what `label` returns for their colour images, (H, W, 3) -> (H, W).

    A frame without colour image has no label image then; if none has one, the pass ends with an InputError.
    """
    count = 0
    for moment in recording.moments():
        cameras = {camera: _relabelled_frame(frame, label) for camera, frame in moment.cameras.items()}
        count += sum(frame.label_png is not None for frame in cameras.values())
        yield replace(moment, cameras=cameras)
    if not count:
        raise InputError("has no colour image", field=recording.name)


def _relabelled_frame(frame: CameraFrame, label: Labeller) -> CameraFrame:
    if frame.image_file is None:
        return replace(frame, label_png=None)
    return replace(frame, label_png=encode_gray(label(decode_colour(frame.image_file))))


@dataclass(frozen=True)
class _Recipe:
    """Everything but the log that determines the new log; it travels to other processes."""

    model: Path
    model_digest: str
    config: SegmentationConfig
    class_map: ClassMap
    device: str

    def record(self, path: Path) -> dict[str, object]:
        """Return what makes the labels of a log."""
        with LogReader(path) as log:
            log_digest = log.digest
        return {
            "model": self.model.name,
            "model_digest": self.model_digest,
            "log_digest": log_digest,
            "config": self.config.model_dump(mode="json", exclude={"classes"}),
            "classes": self.class_map.name,
            "labels": self.class_map.labels,  # of classes in their order
            "device": self.device.partition(":")[0],  # which of several GPUs does not matter
            "method_version": _METHOD_VERSION,
        }

    def digest(self, path: Path) -> str:
        """Digest what makes the new log of a log."""
        return digest_value(self.record(path))

    def recording(self, path: Path) -> Recording:
        """Return the new recording of a log."""
        record = self.record(path)
        recording = read_recording(path)
        moments = partial(_relabelled, recording, self._network().label)
        note = json.dumps(record, indent=2, sort_keys=True).encode()
        files = {**recording.source_files, RECORD: note}
        return replace(recording, moments=moments, source_digest=digest_value(record), source_files=files)

    def _network(self) -> SegmentationNetwork:
        return _opened(self.model, self.model_digest, self.config, self.device)


def _job(path: Path, recipe: _Recipe) -> ConversionJob:
    try:
        with LogReader(path) as log:
            name, split = log.scene.name, log.scene.split
    except LogError:  # named by its place; what is wrong is said when its turn comes
        name, split = path.stem, path.parent.name
    return ConversionJob(name, split, partial(recipe.digest, path), partial(recipe.recording, path))


@lru_cache(maxsize=1)
def _opened(model: Path, model_digest: str, config: SegmentationConfig, device: str) -> SegmentationNetwork:
    """Open a model once for all logs of a process."""
    return SegmentationNetwork(model, config, device=device)


def _refuse_mixing(logs: Sequence[Path], out: Path) -> None:
    target = out.resolve()
    for path in logs:
        source = path.resolve()
        if source.is_relative_to(target) or target.is_relative_to(source):
            message = f"contains or is inside {path}; new logs need a folder of their own"
            raise InputError(message, path=out, field="out")
