"""Measures grids: made from logs, beside decoding their pictures; projected and drawn, beside plain NumPy; scored."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.bench.material import Material, pictures_of
from semgrid_eval.bench.measurement import Measurement, Settings, seconds_passed, times_as_fast, wall_s
from semgrid_eval.bench.rivals import View, confusion_by_definition, decode_by_opencv, grid_by_arrays
from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.executors import local_executor
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.build import build_grids, build_log
from semgrid_eval.grids.rasterise import add_points, no_points, rasterise
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.topics import DISPARITY, LABEL
from semgrid_eval.recording.colour import ImageSize
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.scores.metrics.iou import confusion
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.projection import Projection
from semgrid_eval.sensors.sensor import Points
from semgrid_eval.sources.town.config import FRAME_COUNT
from semgrid_eval.words import plural

SCORED_WINDOWS = 500
_FIVE_SENSORS_AT_MOST = 1.03  # times the decoding of their pictures


def measure_grids(material: Material) -> Iterator[Measurement]:
    """Make the grids of logs, of the whole image alone and with the crops of both splits; and those of many logs."""
    settings = material.settings
    for size_px in settings.pictures_px:
        yield from _measure_log(material, size_px)
    alone, together = (partial(_build_anew, material, workers) for workers in (1, settings.workers))
    gain = times_as_fast(together, alone, settings.repeats, clock=seconds_passed)
    yield Measurement(
        f"{plural(settings.recordings, 'log')}, {plural(settings.workers, 'worker')}",
        gain,
        "times",
        at_least=1.8,
    )


def _measure_log(material: Material, size_px: ImageSize) -> Iterator[Measurement]:
    log, repeats = material.log(size_px), material.settings.repeats
    decode = partial(decode_by_opencv, pictures_of(log, (DISPARITY, LABEL)))
    for config in (GridConfig(sensors={"full": CameraSensor()}), GridConfig()):
        make = partial(build_log, log, config)
        make()  # compiles
        what = f"{size_px}, {plural(len(config.sensors), 'sensor')}"
        yield Measurement(what, FRAME_COUNT / wall_s(make, repeats), "frames/s")
        taken = 1.0 / times_as_fast(make, decode, repeats)
        at_most = _FIVE_SENSORS_AT_MOST if len(config.sensors) > 1 else None
        yield Measurement(f"{what}, against decoding", taken, "times its time", at_most)


def measure_cells(material: Material) -> Iterator[Measurement]:
    """Project a frame's pixels and draw its grid, against plain NumPy, which gives the same grid."""
    config = GridConfig(sensors={"full": CameraSensor()})
    with LogReader(material.log(material.smallest_px)) as log:
        (camera,) = log.scene.cameras
        frame, calibration = next(iter(log.frames(camera))), log.calibration(camera)
    disparity = decode_gray(frame.disparity_png or b"", bit_depth=16)
    label = decode_gray(frame.label_png or b"", bit_depth=8)
    view, turned = View(calibration, CameraSensor().image_size_px, config.class_by_label()), SE2(0.0, 0.0, 0.2)
    projection = Projection(*view)

    def ours() -> NDArray[np.uint8]:
        seen, counts = projection.points(disparity, label), no_points(config)
        add_points(counts, Points("full", 0, seen.forward_m, seen.left_m, seen.class_id), turned, config.spec)
        return rasterise(counts, config.classes, "off")

    def rival() -> NDArray[np.uint8]:
        return grid_by_arrays(disparity, label, view, turned, config.spec)

    if not np.array_equal(ours(), rival()):
        raise AssertionError("plain NumPy draws another grid")
    gain = times_as_fast(ours, rival, 3 * material.settings.repeats)
    yield Measurement("a frame projected and drawn, against NumPy", gain, "times", at_least=15.0)


def measure_scoring(settings: Settings) -> Iterator[Measurement]:
    """Count the cells of each window by both classes, against Cityscapes' way of doing it, which finds the same."""
    random, count = np.random.default_rng(0), min(SCORED_WINDOWS, 8 * settings.windows)
    target, prediction = random.integers(0, CLASS_COUNT, (2, count, 128, 128), dtype=np.uint8)
    left_out = random.random(target.shape) < 0.1
    ours = partial(confusion, target, prediction, left_out, CLASS_COUNT)
    rival = partial(confusion_by_definition, target, prediction, left_out)
    if not np.array_equal(ours(), rival()):
        raise AssertionError("Cityscapes' way finds other counts")
    gain = times_as_fast(ours, rival, settings.repeats)
    yield Measurement(f"{plural(count, 'window')} counted, against Cityscapes' way", gain, "times", at_least=3.0)


def _build_anew(material: Material, workers: int) -> None:
    with TemporaryDirectory(dir=material.folder) as folder:
        build_grids(material.logs, Path(folder), GridConfig(), executor=local_executor(workers))
