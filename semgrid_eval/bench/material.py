"""What is measured: a town, its recording, log and Cityscapes tree, each made when it is first asked for."""

import json
from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path

from semgrid_eval.bench.measurement import Settings
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.motion import MotionSample
from semgrid_eval.progress import silent
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.types import CameraCalibration, Recording
from semgrid_eval.sources.benchmarks import Stereo
from semgrid_eval.sources.town.config import SyntheticConfig
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan, render_recording

_CITY, _CAMERA = "benchtown", "front"


class Material:
    """Inputs of the measurements; towns, logs and the tree lie in `folder`."""

    def __init__(self, folder: Path, settings: Settings) -> None:
        self.folder, self.settings = folder, settings
        self.smallest_px = settings.pictures_px[0]
        self._recordings: dict[ImageSize, Recording] = {}

    def plan(self, stereo: Stereo, size_px: ImageSize) -> RecordingPlan:
        """Plan a recording in the town, which is built once."""
        config = SyntheticConfig(
            recordings=1,
            towns=1,
            val_share=0.0,
            stereo=stereo,
            width=size_px.width,
            height=size_px.height,
            town_size_m=self.settings.town_size_m,
            duration_s=self.settings.duration_s,
        )
        return plan_recordings(config, self.folder / "towns", silent)[0]

    def recording(self, size_px: ImageSize) -> Recording:
        """Return a rendered recording of modelled stereo, its frames in memory."""
        if size_px not in self._recordings:
            recording = render_recording(self.plan("modelled", size_px))
            moments = tuple(recording.moments())
            self._recordings[size_px] = replace(recording, moments=lambda: iter(moments))
        return self._recordings[size_px]

    def log(self, size_px: ImageSize) -> Path:
        """Return the log of that recording."""
        path = self.folder / f"recording-{size_px.width}.mcap"
        if not path.exists():
            write_log(self.recording(size_px), path)
        return path

    @cached_property
    def logs(self) -> list[Path]:
        """As many logs of the smallest pictures as are shared by several workers: links to the one."""
        links = [self.folder / f"recording-{number:03d}.mcap" for number in range(self.settings.recordings)]
        for link in links:
            link.symlink_to(self.log(self.smallest_px))
        return links

    @cached_property
    def tree(self) -> Path:
        """As many recordings of them in Cityscapes' layout."""
        root = self.folder / "tree"
        for sequence in range(self.settings.recordings):
            _write_sequence(root, sequence, self.recording(self.smallest_px))
        return root


def _write_sequence(root: Path, sequence: int, recording: Recording) -> None:
    """Write a recording as a sequence of Cityscapes' layout."""
    calibration = recording.calibrations[_CAMERA]
    for number, moment in enumerate(recording.moments()):
        frame = moment.cameras[_CAMERA]
        files = {
            "leftImg8bit_sequence leftImg8bit.png": frame.image_file,
            "disparity_sequence disparity.png": frame.disparity_png,
            "gtFine gtFine_labelIds.png": frame.label_png,
            "camera camera.json": json.dumps(_camera(calibration)).encode(),
            "timestamp_sequence timestamp.txt": str(moment.stamp_ns).encode(),
            "vehicle_sequence vehicle.json": json.dumps(_vehicle(moment.motion[-1])).encode(),
        }
        for place, content in files.items():
            channel, ending = place.split()
            path = root / channel / "train" / _CITY / f"{_CITY}_{sequence:06d}_{number:06d}_{ending}"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content or b"")


def _camera(calibration: CameraCalibration) -> dict[str, dict[str, float]]:
    """Write a calibration with Cityscapes' names: those of ours without their units."""
    parts: dict[str, dict[str, float]] = {"intrinsic": {}, "extrinsic": {}}
    for name, value in asdict(calibration).items():
        key, _, unit = name.rpartition("_")
        parts["intrinsic" if unit == "px" else "extrinsic"][key] = value
    return parts


def _vehicle(sample: MotionSample) -> dict[str, float]:
    return {"speed": sample.speed_mps, "yawRate": sample.yaw_rate_radps}


def pictures_of(log: Path, channels: Iterable[str]) -> list[bytes]:
    """Return the picture files of some channels of a log's cameras, in the order of time."""
    with LogReader(log) as reader:
        return [picture.png for picture in reader.pictures(reader.scene.cameras, channels)]
