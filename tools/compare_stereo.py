"""Hold the stereo of logs side by side, by range: how dense, how far off, and how steady the grids made of it are.

Works on real and on simulated logs. Nothing but the error against the truth needs the truth, so that the other columns
are computed alike for both. Where a pixel has no disparity, its range is that of the nearest pixel of the same label
that has one.

Example: python tools/compare_stereo.py real=logs/real town=logs/town --windows 2
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, UNKNOWN
from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.recording import GridRecording
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.windows.grids import shift_grids, shift_in_cells

RANGES_M = ((0, 10), (10, 20), (20, 30), (30, 40), (40, 60))
STEP_S = 0.3
"""From a grid to the one that it is compared with."""
DEPTH_DISPARITY_M_PX = 473.0
"""Focal length times base of Cityscapes' camera at full size, in whose pixels errors are told."""
FAR_OFF_PX = 3.0
SHOWN = ("road", "sidewalk", "building", "vegetation", "pole_sign", "car")
_SIZE_PX = (512, 256)
_REACH_PX = 4  # of the neighbourhood whose median a pixel is held against
_EVERY_PX = 3
_LAST_VOID = LABEL_ID["ground"]
Floats = NDArray[np.float64]
T = TypeVar("T")


@dataclass
class Tally:
    """What the pixels of some frames add up to; rows are ranges, and the parts of a row are joined at the end."""

    seen: Floats = field(default_factory=lambda: np.zeros(len(RANGES_M)))
    valid: Floats = field(default_factory=lambda: np.zeros(len(RANGES_M)))
    stray: list[list[Floats]] = field(default_factory=lambda: [[] for _ in RANGES_M])
    error_m: list[list[Floats]] = field(default_factory=lambda: [[] for _ in RANGES_M])
    error_px: list[list[Floats]] = field(default_factory=lambda: [[] for _ in RANGES_M])
    sky: list[float] = field(default_factory=list)


def main() -> None:
    """Parse the options, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", help="NAME=FOLDER of logs")
    parser.add_argument("--frames", type=_count, default=2, help="frames of each log whose pixels are measured")
    parser.add_argument("--windows", type=_count, default=4, help="pairs of grids of each log")
    parser.add_argument("--recordings", type=_count, default=10_000, help="logs of each folder")
    options = parser.parse_args()
    try:
        for entry in options.logs:
            name, _, folder = entry.rpartition("=")
            logs = _spread(find_logs(Path(folder)), options.recordings)
            print(f"{name or folder}: {len(logs)} logs")
            _print_pixels(_measure_pixels(logs, options.frames))
            _print_grids(_measure_grids(logs, options.windows))
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not 1 or more")
    return int(text)


def _spread(items: Sequence[T], count: int) -> list[T]:
    """Choose that many items, or all, from first to last."""
    return [items[i * len(items) // min(count, len(items))] for i in range(min(count, len(items)))]


def _measure_pixels(logs: list[Path], count: int) -> Tally:
    tally = Tally()
    for log in logs:
        with LogReader(log) as reader:
            camera = reader.scene.cameras[0]
            calibration = reader.calibration(camera)
            depth_disparity = calibration.depth_disparity_m_px
            chosen = set(_spread(range(sum(1 for _ in reader.frames(camera))), count))
            for index, frame in enumerate(reader.frames(camera)):
                if index in chosen:
                    _add_pixels(tally, frame, depth_disparity)
    return tally


def _add_pixels(tally: Tally, frame: CameraFrame, depth_disparity_m_px: float) -> None:
    found = _disparity(frame.disparity_png or b"", depth_disparity_m_px)
    reached = slice(_first_column(found), None)
    found = found[:, reached]
    label = _small(decode_gray(frame.label_png or b"", bit_depth=8))[:, reached].astype(np.uint8)
    is_sky = label == LABEL_ID["sky"]
    if is_sky.any():
        tally.sky.append(float(np.mean(found[is_sky] > 0.0)))
    solid = (label > _LAST_VOID) & ~is_sky
    range_m = DEPTH_DISPARITY_M_PX / np.maximum(_filled(found, label), 1e-3)
    stray = _off_median_px(found, label)
    for row, (near_m, far_m) in enumerate(RANGES_M):
        inside = solid & (range_m >= near_m) & (range_m < far_m)
        tally.seen[row] += inside.sum()
        tally.valid[row] += (inside & (found > 0.0)).sum()
        tally.stray[row].append(stray[inside & np.isfinite(stray)])
    if frame.exact_disparity_png:
        _add_errors(tally, found, _disparity(frame.exact_disparity_png, depth_disparity_m_px)[:, reached])


def _add_errors(tally: Tally, found: Floats, exact: Floats) -> None:
    true_m = DEPTH_DISPARITY_M_PX / np.maximum(exact, 1e-3)
    for row, (near_m, far_m) in enumerate(RANGES_M):
        both = (true_m >= near_m) & (true_m < far_m) & (found > 0.0)
        tally.error_px[row].append((found - exact)[both])
        tally.error_m[row].append(np.abs(DEPTH_DISPARITY_M_PX / found[both] - true_m[both]))


def _small(image: NDArray[np.generic]) -> NDArray[np.generic]:
    """Bring an image (H, W) to the size at which grids are made."""
    return np.asarray(cv2.resize(np.asarray(image), _SIZE_PX, interpolation=cv2.INTER_NEAREST))


def _disparity(png: bytes | None, depth_disparity_m_px: float) -> Floats:
    """Return the disparity (H, W) that the camera of full size would have; 0 where there is none."""
    coded = _small(decode_gray(png or b"", bit_depth=16)).astype(np.float64)
    return np.where(coded > 1.0, (coded - 1.0) / 256.0, 0.0) * (DEPTH_DISPARITY_M_PX / depth_disparity_m_px)


def _first_column(found: Floats) -> int:
    """Return the first column that matching can reach at all."""
    return int(np.argmax(np.mean(found > 0.0, axis=0) > 0.02))


def _filled(found: Floats, label: NDArray[np.generic]) -> Floats:
    """Give each pixel without disparity that of the nearest pixel of its label that has one, and else 0."""
    filled = found.copy()
    for value in np.unique(label):
        has = (label == value) & (found > 0.0)
        missing = (label == value) & (found <= 0.0)
        if has.any() and missing.any():
            _, nearest = cv2.distanceTransformWithLabels(
                (~has).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
            )
            by_index = np.zeros(nearest.max() + 1)
            by_index[nearest[has]] = found[has]
            filled[missing] = by_index[nearest[missing]]
    return filled


def _off_median_px(found: Floats, label: NDArray[np.generic]) -> Floats:
    """Return how far a disparity is from the median of its neighbours of the same label; NaN off a lattice."""
    size = 2 * _REACH_PX + 1
    near = np.lib.stride_tricks.sliding_window_view(found, (size, size))[::_EVERY_PX, ::_EVERY_PX]
    near_label = np.lib.stride_tricks.sliding_window_view(label, (size, size))[::_EVERY_PX, ::_EVERY_PX]
    own = near[:, :, _REACH_PX, _REACH_PX]
    own_label = near_label[:, :, _REACH_PX, _REACH_PX]
    alike = (near_label == own_label[..., None, None]) & (near > 0.0)
    usable = (own > 0.0) & (alike.sum(axis=(2, 3)) >= 20)
    values = np.where(alike[usable], near[usable], np.nan)
    result = np.full(found.shape, np.nan)
    place = result[_REACH_PX:-_REACH_PX, _REACH_PX:-_REACH_PX][::_EVERY_PX, ::_EVERY_PX]
    if usable.any():
        place[usable] = np.abs(own[usable] - np.nanmedian(values.reshape(len(values), -1), axis=1))
    return result


def _print_pixels(tally: Tally) -> None:
    print(f"  sky with disparity {np.mean(tally.sky):.2f}" if tally.sky else "  no sky")
    print("  range     share  density  from neighbours: median, > 3 px  from truth: median, > 3 px, depth")
    for row, (near_m, far_m) in enumerate(RANGES_M):
        stray = np.concatenate(tally.stray[row])
        line = f"  {near_m:2d}-{far_m:2d} m  {tally.seen[row] / tally.seen.sum():5.2f}    "
        line += f"{tally.valid[row] / max(tally.seen[row], 1):5.2f}        {_median(stray):5.2f} px, "
        line += f"{_share_off(stray):5.3f}"
        if tally.error_px[row]:
            error_px, error_m = (np.concatenate(part[row]) for part in (tally.error_px, tally.error_m))
            line += f"           {_median(np.abs(error_px)):5.2f} px, {_share_off(error_px):5.3f}, "
            line += f"{_median(error_m):5.2f} m"
        print(line)


def _median(values: Floats) -> float:
    return float(np.median(values)) if len(values) else float("nan")


def _share_off(values: Floats) -> float:
    return float(np.mean(np.abs(values) > FAR_OFF_PX)) if len(values) else float("nan")


def _measure_grids(logs: list[Path], count: int) -> NDArray[np.int64]:
    """Count cells (ranges, newer class, older class there) but those that are known in the older grid alone."""
    config = GridConfig(sensors={"full": CameraSensor()})
    spec = config.spec
    range_m = spec.ranges_m()
    total = np.zeros((len(RANGES_M), CLASS_COUNT, CLASS_COUNT), np.int64)
    for log in logs:
        for recording in build_log(log, config):
            for older, newer in _pairs(recording, count, spec.cell_m):
                for row, (near_m, far_m) in enumerate(RANGES_M):
                    chosen = (range_m >= near_m) & (range_m < far_m) & ~((newer == UNKNOWN) & (older != UNKNOWN))
                    np.add.at(total[row], (newer[chosen], older[chosen]), 1)
    return total


def _pairs(
    recording: GridRecording, count: int, cell_m: float
) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
    """Give grids, moved by the vehicle's own motion to the time of the grid `STEP_S` later, and that grid."""
    stamps_s = (recording.stamps_ns - recording.stamps_ns[0]) * 1e-9
    for index in _spread(np.flatnonzero(stamps_s >= STEP_S - 0.02).tolist(), count):
        earlier = int(np.argmin(np.abs(stamps_s[index] - STEP_S - stamps_s)))
        shift = shift_in_cells(recording.position_m[index] - recording.position_m[earlier], cell_m)
        moved = shift_grids(torch.from_numpy(recording.grids[0, earlier]), torch.from_numpy(shift))
        yield moved.numpy(), recording.grids[0, index]


def _print_grids(total: NDArray[np.int64]) -> None:
    print("  range     cells known  known before  same class | IoU of " + ", ".join(SHOWN))
    for (near_m, far_m), counts in zip((*RANGES_M, (0, 60)), (*total, total.sum(axis=0)), strict=True):
        known = counts[1:]
        same = np.trace(counts[1:, 1:]) / max(known[:, 1:].sum(), 1)
        line = f"  {near_m:2d}-{far_m:2d} m   {known.sum() / max(counts.sum(), 1):8.2f}   "
        line += f"{known[:, 1:].sum() / max(known.sum(), 1):10.2f}  {same:10.2f}   |"
        union = counts.sum(axis=0) + counts.sum(axis=1) - np.diag(counts)
        for name in SHOWN:
            index = CLASS_NAMES.index(name)
            line += f" {np.diag(counts)[index] / union[index]:.2f}" if union[index] else "   - "
        print(line)


if __name__ == "__main__":
    main()
