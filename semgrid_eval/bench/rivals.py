"""What the fast parts are held against: by definition in plain NumPy with equal results, or by other libraries."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, DEFAULT_CLASSES, NO_POINT
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.spec import GridSpec
from semgrid_eval.recording.resizing import nearest
from semgrid_eval.recording.types import CameraCalibration
from semgrid_eval.sensors.projection import ground_slope

Image = NDArray[np.uint8] | NDArray[np.uint16]
Grid = NDArray[np.uint8]


class View(NamedTuple):
    """What decides the points of a camera's images."""

    calibration: CameraCalibration
    size_px: tuple[int, int]  # width and height to which images are brought (nearest pixel)
    class_by_label: Grid  # (256,) grid class, or `NO_POINT`, of each label id


def grid_by_arrays(disparity: Image, label: Image, view: View, grid_from_vehicle: SE2, spec: GridSpec) -> Grid:
    """Project the pixels of an image and let the strongest class of each cell win, without morphology.

    Args:
        disparity: (h, w) 16 bit, d_px = (p - 1) / 256; 0 is invalid, 1 at infinity.
        label: (h, w) label ids.
        view: of the camera.
        grid_from_vehicle: to the grid's axes around the vehicle.
        spec: extent of the grid (rows, columns), which is returned.
    """
    camera = view.calibration
    slope = ground_slope(camera, (disparity.shape[1], disparity.shape[0]), view.size_px)
    disparity, label = (nearest(image, view.size_px) for image in (disparity, label))
    class_id = np.where(disparity > 1, view.class_by_label[label], NO_POINT)
    used = class_id != NO_POINT
    depth_m = camera.depth_disparity_m_px * 256.0 / (disparity[used] - 1.0)
    place_m = np.array([[camera.x_m], [camera.y_m]]) + depth_m * slope[:, used]
    counts = _counted(place_m, class_id[used], grid_from_vehicle, spec)
    rank = np.where(
        counts > 0, DEFAULT_CLASSES.priorities()[:, None, None].astype(np.int64) * 2 * counts.max() + counts, 0
    )
    return np.asarray(rank.argmax(axis=0), np.uint8)


def _counted(place_m: NDArray[np.float64], class_id: Grid, move: SE2, spec: GridSpec) -> NDArray[np.int64]:
    """Count points (2, N) by class and cell: -> (C, rows, columns)."""
    cosine, sine = math.cos(move.yaw_rad), math.sin(move.yaw_rad)
    ahead_m = cosine * place_m[0] - sine * place_m[1] + move.x_m
    aside_m = sine * place_m[0] + cosine * place_m[1] + move.y_m
    row = spec.agent_row - 1 - np.floor(ahead_m / spec.cell_m).astype(np.int64)
    column = spec.agent_column - 1 - np.floor(aside_m / spec.cell_m).astype(np.int64)
    inside = (row >= 0) & (row < spec.rows) & (column >= 0) & (column < spec.columns)
    counts = np.zeros((CLASS_COUNT, spec.rows, spec.columns), np.int64)
    np.add.at(counts, (class_id[inside], row[inside], column[inside]), 1)
    return counts


def confusion_by_definition(target: Grid, prediction: Grid, left_out: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Count cells by target and predicted class in each window: (N, H, W) each -> (N, C, C).

    As Cityscapes' evaluation does it for an image: pairs of classes become numbers, whose different values are counted.
    """
    found = np.zeros((len(target), CLASS_COUNT, CLASS_COUNT), np.int64)
    for window, (truth, answer, ignored) in enumerate(zip(target, prediction, left_out, strict=True)):
        pairs = truth[~ignored].astype(np.int32) * CLASS_COUNT + answer[~ignored]
        for pair, count in zip(*np.unique(pairs, return_counts=True), strict=True):
            found[window, pair // CLASS_COUNT, pair % CLASS_COUNT] += count
    return found


def decode_by_opencv(pictures: Iterable[bytes]) -> None:
    """Decode picture files."""
    for picture in pictures:
        cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_UNCHANGED)


def read_by_library(log: Path) -> None:
    """Read all messages of a log by the MCAP library, checksums included."""
    with log.open("rb") as stream:
        for _ in make_reader(stream, validate_crcs=True).iter_messages():
            pass
