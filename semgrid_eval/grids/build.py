"""Grids of whole recordings: read a log once, make the grids of every sensor, keep them by digest."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.arrays import read_arrays, write_arrays
from semgrid_eval.errors import LogError, ResultError, SemgridError
from semgrid_eval.executors import Executor, InProcess, WorkerDied
from semgrid_eval.files import digest_value
from semgrid_eval.grids.actors import TrueActors
from semgrid_eval.grids.geometry import GroundRays, ground_rays, nearest_indices
from semgrid_eval.grids.motion import integrate_motion
from semgrid_eval.grids.rasterise import LabelledImage, count_points, rasterise
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.store import LogReader
from semgrid_eval.progress import Progress, silent
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import CameraFrame, MotionSample

FORMAT_VERSION = 2

StretchArrays = tuple[
    NDArray[np.int64], NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8] | None
]
_ARRAYS = ("stamps_ns", "grids", "position_m", "yaw_rad")


@dataclass(frozen=True)
class GridRecording:
    """The grids of one recording, all in the orientation of its first frame (reading 18).

    Args:
        name: of the recording; the stretches of a longer log are told apart by `#1`, `#2`, ...
        log: path of its log.
        digest: of the log.
        split: `train`, `val` or `test`.
        dataset: where it comes from.
        sensors: names, in the order of `grids`.
        stamps_ns: (F,) capture times.
        grids: (S, F, H, W) uint8 class ids; each grid is centred on the vehicle at its own time.
        position_m: (F, 2) of the vehicle, forward and left of the first frame.
        yaw_rad: (F,) heading against the first frame.
        actors: (F, H, W) uint8, where true actors stand at each frame's time: bits `STANDING` and `MOVING` of the
            grid's spec; None where the log does not hold the truth.
    """

    name: str
    log: str
    digest: str
    split: str
    dataset: str
    sensors: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    grids: NDArray[np.uint8]
    position_m: NDArray[np.float64]
    yaw_rad: NDArray[np.float64]
    actors: NDArray[np.uint8] | None = None


@dataclass
class GridDataSet:
    """The grids of many logs; `failed` holds the reason for each log that gave none."""

    recordings: list[GridRecording] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)
    built: int = 0
    reused: int = 0


def build_grids(
    logs: Sequence[Path],
    folder: Path,
    config: GridConfig,
    *,
    sensors: Sequence[str] | None = None,
    executor: Executor | None = None,
    progress: Progress = silent,
) -> GridDataSet:
    """Make the grids of all logs, or take those that lie in `folder` already, as many at once as `executor` works on.

    A log that fails is noted with its reason and the others go on. The order of recordings is that of `logs`. Grids of
    all sensors are made; with `sensors`, only those of these are read into memory.
    """
    data = GridDataSet()
    ready: dict[Path, list[GridRecording]] = {}
    missing: list[Path] = []
    for log in logs:
        try:
            ready[log] = _only(_read(_cache_file(log, folder, config), log), sensors)
        except ResultError:
            missing.append(log)  # not made yet, or damaged
        except SemgridError as error:
            data.failed[str(log)] = _about(log, error)
    data.reused = len(ready)
    work = partial(_build_and_keep, folder=folder, config=config)
    for done, (index, failure) in enumerate((executor or InProcess()).run(work, missing), start=1):
        log = missing[index]
        progress(done, len(missing), log.stem)
        if failure is not None:
            data.failed[str(log)] = failure.reason if isinstance(failure, WorkerDied) else failure
            continue
        # Workers leave their grids on disk: reading them costs less than sending them between processes.
        ready[log] = _only(_read(_cache_file(log, folder, config), log), sensors)
        data.built += 1
    data.recordings = [recording for log in logs for recording in ready.get(log, [])]
    return data


def _only(recordings: list[GridRecording], sensors: Sequence[str] | None) -> list[GridRecording]:
    if sensors is None:
        return recordings
    kept = tuple(name for name in recordings[0].sensors if name in sensors)
    rows = [recordings[0].sensors.index(name) for name in kept]
    return [replace(recording, sensors=kept, grids=recording.grids[rows]) for recording in recordings]


def build_log(log: Path, config: GridConfig) -> list[GridRecording]:
    """Make the grids of one log, cut into stretches.

    Raises:
        LogError: the log is damaged or lacks what a grid needs.
    """
    with closing(LogReader(log)) as reader:
        camera = reader.choose_camera(config.camera)
        motion = list(reader.motion())
        frames = reader.frames(camera)
        truth = TrueActors(reader, config.spec)
        stretches: list[StretchArrays] = []
        while stretch := list(_take(frames, config.stretch_frames)):
            if stretches and len(stretch) < config.stretch_frames:
                break  # the rest of a log that was cut: too short for the windows of the others
            stretches.append(_build_stretch(stretch, motion, truth, _Stretch(reader, camera, config), config))
        if not stretches:
            raise LogError(f"camera {camera} has no frames", path=log)
        many = len(stretches) > 1
        return [
            GridRecording(
                f"{reader.scene.name}#{number}" if many else reader.scene.name,
                str(log),
                reader.digest,
                reader.scene.split,
                reader.scene.dataset,
                tuple(sensor.name for sensor in config.all_sensors()),
                *arrays,
            )
            for number, arrays in enumerate(stretches, start=1)
        ]


class _Stretch:
    """Turns frames into grids; what does not change from frame to frame is computed once."""

    def __init__(self, reader: LogReader, camera: str, config: GridConfig) -> None:
        self._calibration = reader.calibration(camera)
        self._config = config
        self._table = config.class_by_label()
        self._rays: dict[tuple[int, int], GroundRays] = {}
        self._crops = np.array([[s.top_px, s.bottom_px, s.left_px, s.right_px] for s in config.all_sensors()], np.int64)

    def grids(self, frame: CameraFrame, yaw_rad: float) -> NDArray[np.uint8]:
        """Return the grids (S, H, W) of one frame."""
        width, height = self._config.image_size_px
        disparity = decode_gray(frame.disparity_png, bit_depth=16)
        label = decode_gray(frame.label_png or b"", bit_depth=8)
        size = (disparity.shape[1], disparity.shape[0])
        if size not in self._rays:
            self._rays[size] = ground_rays(self._calibration, size, (width, height))
        image = LabelledImage(
            self._table[_resize(label, width, height)], np.ascontiguousarray(_resize(disparity, width, height))
        )
        counts = count_points(image, self._rays[size], yaw_rad, self._crops, self._config.spec)
        return np.stack([rasterise(sensor, self._config.morphology) for sensor in counts])


def _build_stretch(
    frames: list[CameraFrame], motion: list[MotionSample], truth: TrueActors, stretch: _Stretch, config: GridConfig
) -> StretchArrays:
    stamps_ns = np.array([frame.stamp_ns for frame in frames], np.int64)
    position_m, yaw_rad = integrate_motion(motion, stamps_ns, config.integrator)
    grids = np.stack([stretch.grids(frame, yaw) for frame, yaw in zip(frames, yaw_rad, strict=True)], axis=1)
    return stamps_ns, grids, position_m, yaw_rad, truth.flags(stamps_ns, yaw_rad)


def _take(frames: Iterator[CameraFrame], count: int) -> Iterator[CameraFrame]:
    for frame in islice(frames, count):
        if not frame.label_png:
            raise LogError(
                "has no label image; add labels to the log (convert cityscapes --labels DIR)",
                field=f"frame at {frame.stamp_ns} ns",
            )
        yield frame


def _resize(image: NDArray[np.uint8] | NDArray[np.uint16], width: int, height: int) -> NDArray[np.generic]:
    rows, columns = nearest_indices(image.shape[0], height), nearest_indices(image.shape[1], width)
    return image[rows[:, None], columns[None, :]]


def _build_and_keep(log: Path, folder: Path, config: GridConfig) -> str | None:
    """Make the grids of a log, or return why not."""
    try:
        _write(_cache_file(log, folder, config), build_log(log, config))
    except SemgridError as error:
        return _about(log, error)
    return None


def _cache_file(log: Path, folder: Path, config: GridConfig) -> Path:
    with closing(LogReader(log)) as reader:
        key = {"log": reader.digest, "config": config.model_dump(mode="json"), "format": FORMAT_VERSION}
    return folder / f"{log.stem}-{digest_value(key)}.npz"


def _about(log: Path, error: SemgridError) -> str:
    return str(error) if str(log) in str(error) else f"{log}: {error}"


def _write(path: Path, recordings: list[GridRecording]) -> None:
    first = recordings[0]
    arrays: dict[str, NDArray[np.generic]] = {
        "names": np.array([recording.name for recording in recordings]),
        "log": np.array([first.digest, first.split, first.dataset, *first.sensors]),
    }
    for number, recording in enumerate(recordings):
        for name in _ARRAYS:
            arrays[f"{name}_{number}"] = getattr(recording, name)
        if recording.actors is not None:
            arrays[f"actors_{number}"] = recording.actors
    write_arrays(path, arrays)


def _read(path: Path, log: Path) -> list[GridRecording]:
    head = read_arrays(path, ("names", "log"))
    digest, split, dataset, *sensors = (str(value) for value in head["log"])
    recordings = []
    for number, name in enumerate(head["names"]):
        keys, truth = tuple(f"{key}_{number}" for key in _ARRAYS), f"actors_{number}"
        found = read_arrays(path, keys, optional=(truth,))
        arrays = {key.removesuffix(f"_{number}"): array for key, array in found.items()}
        recordings.append(GridRecording(str(name), str(log), digest, split, dataset, tuple(sensors), **arrays))
    return recordings
