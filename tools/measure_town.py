"""Measure the simulated town (costs, speeds, errors of disparity) and draw a contact sheet of it.

Example: python tools/measure_town.py /tmp/town --recordings 12
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
import time
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from semgrid_eval.classes import label_palette
from semgrid_eval.frames.synthetic.drives import FRAME_COUNT, ego_path
from semgrid_eval.frames.synthetic.recordings import (
    RecordingPlan,
    SyntheticConfig,
    plan_recordings,
    render_recording,
)
from semgrid_eval.frames.synthetic.sensors import FULL_WIDTH_PX
from semgrid_eval.frames.synthetic.town import load_town
from semgrid_eval.frames.types import CameraFrame

RANGES_M = ((0, 10), (10, 20), (20, 40), (40, 60), (60, 100))
SIZES_PX = {"modelled": (512, 256), "matched": (1024, 512)}
NEAR_JET_PX = 0.045  # disparity, as a share of the image's width, that the sheet shows as red


def main() -> None:
    """Parse the options, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the towns and of sheet.png")
    parser.add_argument("--recordings", type=int, default=12)
    parser.add_argument("--speeds", type=int, default=400, help="windows drawn to measure their speeds")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    measure_speeds(options.out, options.speeds, options.seed)
    for stereo, (width, height) in SIZES_PX.items():
        config = SyntheticConfig(
            recordings=options.recordings, seed=options.seed, stereo=stereo, width=width, height=height
        )
        plans = plan_recordings(config, options.out, _quiet)
        measure_rendering(plans[0])
        measure_disparity(plans)
        draw_sheet(plans[:: max(1, len(plans) // 6)], options.out / f"sheet_{stereo}.png")


def measure_speeds(cache: Path, count: int, seed: int) -> None:
    """Print what towns cost and how fast the ego vehicles of many windows drive."""
    start_s = time.perf_counter()
    plans = plan_recordings(SyntheticConfig(recordings=count, seed=seed), cache, _quiet)
    print(f"{len({plan.town for plan in plans})} towns and {count} windows: {time.perf_counter() - start_s:.1f} s")
    speeds, turns = np.array([_drive(plan) for plan in plans]).T
    moving = speeds[speeds >= 2.0]
    print(
        f"below 2 m/s: {np.mean(speeds < 2.0):.2f}, median of the rest {np.median(moving):.1f} m/s, "
        f"above 11 m/s: {np.mean(speeds > 11.0):.2f}, turning by more than 10 degrees: {np.mean(turns > 10.0):.2f}"
    )


def measure_rendering(plan: RecordingPlan) -> None:
    """Print what rendering one recording costs."""
    next(iter(render_recording(plan).moments()))
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    frames = sum(1 for _ in render_recording(plan).moments())
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    size = f"{plan.width_px} x {plan.height_px}"
    print(f"{plan.stereo}, {size}: {frames} frames in {wall_s:.2f} s ({cpu_s:.2f} s of processor time)")


def measure_disparity(plans: list[RecordingPlan]) -> None:
    """Print how often disparity is missing and how wrong it is, by range."""
    depth, exact_px, found_px = [], [], []
    for plan in plans:
        recording = render_recording(plan)
        calibration = recording.calibrations["front"]
        for moment in islice(recording.moments(), 2):
            frame = moment.cameras["front"]
            exact, found = (_disparity_px(png) for png in (frame.exact_disparity_png, frame.disparity_png))
            solid = exact > 0.0
            exact_px.append(exact[solid])
            found_px.append(found[solid])
            depth.append(calibration.fx_px * calibration.baseline_m / exact[solid])
    depth_m, exact, found = (np.concatenate(parts) for parts in (depth, exact_px, found_px))
    valid = found > 0.0
    error_px = (found - exact)[valid] * FULL_WIDTH_PX / plans[0].width_px
    sigma_px = 1.4826 * np.median(np.abs(error_px - np.median(error_px)))
    print(
        f"  valid {valid.mean():.2f}, error in px of 2048: bias {np.median(error_px):.2f}, robust sigma {sigma_px:.2f}"
    )
    print(f"  more than 3 px off: {np.mean(np.abs(error_px) > 3.0):.3f}")
    for near_m, far_m in RANGES_M:
        inside = (depth_m >= near_m) & (depth_m < far_m)
        wrong_m = np.abs(depth_m * exact / np.maximum(found, 1e-6) - depth_m)[inside & valid]
        missing = 1.0 - valid[inside].mean()
        print(f"  {near_m} to {far_m} m: missing {missing:.3f}, median depth error {np.median(wrong_m):.2f} m")


def draw_sheet(plans: list[RecordingPlan], path: Path) -> None:
    """Write a picture with a row a recording: image, exact labels, labels with errors, disparity."""
    rows = [_row(next(iter(render_recording(plan).moments())).cameras["front"]) for plan in plans]
    cv2.imwrite(str(path), np.concatenate(rows, axis=0))
    print(f"  {path}")


def _drive(plan: RecordingPlan) -> tuple[float, float]:
    path = ego_path(load_town(plan.town).traffic, plan.drive)
    assert path is not None
    states = np.array([path.at(plan.drive.start_s + index / 17.0) for index in range(FRAME_COUNT)])
    return float(states[:, 3].mean()), float(np.rad2deg(abs(states[-1, 2] - states[0, 2])))


def _row(frame: CameraFrame) -> NDArray[np.uint8]:
    palette = label_palette()[:, ::-1]
    disparity = _disparity_px(frame.disparity_png)
    shown = np.clip(disparity / (NEAR_JET_PX * disparity.shape[1]) * 255.0, 0, 255).astype(np.uint8)
    jet = cv2.applyColorMap(shown, cv2.COLORMAP_JET)
    jet[disparity == 0.0] = 0
    labels = [palette[_pixels(png)] for png in (frame.exact_label_png, frame.label_png) if png is not None]
    row = np.concatenate([_pixels(frame.image_png or b""), *labels, jet], axis=1)
    return np.asarray(cv2.resize(row, (4 * 512, 256), interpolation=cv2.INTER_NEAREST))


def _pixels(png: bytes) -> NDArray[np.uint8]:
    return np.asarray(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED))


def _disparity_px(png: bytes | None) -> NDArray[np.float64]:
    coded = _pixels(png or b"").astype(np.float64)
    return np.where(coded > 0.0, (coded - 1.0) / 256.0, 0.0)


def _quiet(done: int, total: int, message: str = "") -> None:
    """Show no progress."""


if __name__ == "__main__":
    main()
