"""Measure how wrong simulated logs are against their own truth, and what the ends of the ranges of `varied` do.

Labels are counted by Cityscapes label, over those with 500 pixels in the frames that are measured; disparity where
there is something solid, in pixels of an image 2048 px wide.

Examples: python tools/measure_errors.py town=logs/town varied=logs/varied
          python tools/measure_errors.py --ends logs/town
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.errors import SemgridError
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.recording.types import CameraFrame
from semgrid_eval.sources.town.noise import (
    FULL_WIDTH_PX,
    DisparityErrors,
    DisparityNoise,
    LabelErrors,
    LabelNoise,
)
from semgrid_eval.sources.town.varied import RANGES

EVERY_FRAME, LOGS_OF_ENDS = 3, 8
LEAST_PIXELS = 500
FAR_OFF_PX = 3.0
KINDS = {
    "smooth": ("disparity", ("correlated_px",)),
    "slow": ("disparity", ("slow_px",)),
    "per pixel": ("disparity", ("white_px",)),
    "mismatches": ("disparity", ("mismatched", "mismatch_px")),
    "dropouts": ("disparity", ("dropout", "far_dropout", "speckle")),
    "grown borders": ("disparity", ("fattened",)),
    "bent borders": ("label", ("warp_px", "border_px", "bad_borders")),
    "confusion": ("label", ("confused_px", "confused")),
    "mistakes": ("label", ("mistaken",)),
}
"""What the parts of `RANGES` are called in docs/town.md, and which of its numbers make each."""


class Pictures(NamedTuple):
    """Exact and measured labels and disparities (H, W) of a frame; disparity is in its own pixels, 0 where invalid."""

    exact_label: NDArray[np.uint8]
    label: NDArray[np.uint8]
    exact_px: NDArray[np.float32]
    found_px: NDArray[np.float32]


class Errors(NamedTuple):
    """How wrong the frames of a log are."""

    accuracy: float
    mean_iou: float
    density: float
    median_px: float
    far_off: float


def main() -> None:
    """Parse the options, measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", help="NAME=FOLDER of simulated logs")
    parser.add_argument("--ends", action="store_true", help="put errors of the ends of each range on exact pictures")
    options = parser.parse_args()
    try:
        for entry in options.logs:
            name, _, folder = entry.rpartition("=")
            logs = find_logs(Path(folder))
            print(f"{name or folder}: {len(logs)} logs")
            (print_ends if options.ends else print_spread)(logs)
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None


def print_spread(logs: list[Path]) -> None:
    """Print the percentiles of each error over logs."""
    measured = np.array([errors_of(pictures(log)) for log in logs])
    for name, column in zip(Errors._fields, measured.T, strict=True):
        shares = ", ".join(f"{value:.3f}" for value in np.percentile(column, (0, 10, 50, 90, 100)))
        print(f"  {name:10s} least, 10 %, median, 90 %, most: {shares}")


def print_ends(logs: list[Path]) -> None:
    """Print the errors that the two ends of each kind's ranges make, all else as usual."""
    some = logs[:: max(1, len(logs) // LOGS_OF_ENDS)][:LOGS_OF_ENDS]
    exact = [list(pictures(log)) for log in some]
    print(f"  {'usual':14s}       {_worded(again(exact, DisparityNoise(), LabelNoise()))}")
    every = {"all": (None, ()), **KINDS}
    for (kind, (part, names)), end in ((item, end) for item in every.items() for end in ("low", "high")):
        disparity, label = (_at(each, end, names if part else ()) for each in ("disparity", "label"))
        found = again(
            exact,
            replace(DisparityNoise(), **(disparity if part in (None, "disparity") else {})),
            replace(LabelNoise(), **(label if part in (None, "label") else {})),
        )
        print(f"  {kind:14s} {end:5s} {_worded(found)}")


def _at(part: str, end: str, names: Iterable[str]) -> dict[str, float]:
    """Return an end of some ranges of a part, or of all where no names are given."""
    return {name: getattr(RANGES[part][name], end) for name in (names or RANGES[part]) if name in RANGES[part]}


def again(logs: list[list[Pictures]], disparity: DisparityNoise, label: LabelNoise) -> Errors:
    """Put errors on the exact pictures of logs, frame after frame, and measure them over all."""
    frames: list[Pictures] = []
    for seed, exact in enumerate(logs):
        disparities = DisparityErrors(disparity, np.random.default_rng([seed, 0]))
        labels = LabelErrors(label, np.random.default_rng([seed, 1]))
        frames += [
            each._replace(label=labels.add(each.exact_label), found_px=disparities.add(each.exact_px)) for each in exact
        ]
    return errors_of(frames)


def pictures(log: Path) -> Iterator[Pictures]:
    """Decode one frame in three of a log with truth."""
    with LogReader(log) as reader:
        for index, frame in enumerate(reader.frames(reader.scene.cameras[0])):
            if index % EVERY_FRAME == 0:
                yield decoded(frame)


def decoded(frame: CameraFrame) -> Pictures:
    """Decode the exact and the measured pictures of a frame."""
    exact, found = (_disparity_px(png) for png in (frame.exact_disparity_png, frame.disparity_png))
    return Pictures(_label(frame.exact_label_png), _label(frame.label_png), exact, found)


def _label(png: bytes | None) -> NDArray[np.uint8]:
    return decode_gray(png or b"", bit_depth=8).astype(np.uint8)


def _disparity_px(png: bytes | None) -> NDArray[np.float32]:
    coded = decode_gray(png or b"", bit_depth=16).astype(np.float32)
    return np.asarray(np.maximum(coded - 1.0, 0.0) / 256.0, np.float32)


def errors_of(frames: Iterable[Pictures]) -> Errors:
    """Measure frames."""
    confusion = np.zeros((256, 256), np.int64)
    solid, off_px = 0, []
    for frame in frames:
        np.add.at(confusion, (frame.exact_label, frame.label), 1)
        both = (frame.exact_px > 0.0) & (frame.found_px > 0.0)
        solid += int((frame.exact_px > 0.0).sum())
        scale = FULL_WIDTH_PX / frame.exact_px.shape[1]
        off_px.append(np.abs(frame.found_px - frame.exact_px)[both] * scale)
    every_px, right = np.concatenate(off_px), np.diag(confusion)
    iou = right / np.maximum(confusion.sum(axis=0) + confusion.sum(axis=1) - right, 1)
    return Errors(
        accuracy=float(right.sum() / confusion.sum()),
        mean_iou=float(iou[confusion.sum(axis=1) >= LEAST_PIXELS].mean()),
        density=len(every_px) / solid,
        median_px=float(np.median(every_px)),
        far_off=float((every_px > FAR_OFF_PX).mean()),
    )


def _worded(found: Errors) -> str:
    labels = f"labels: accuracy {found.accuracy:.3f}, mean IoU {found.mean_iou:.3f}"
    off = f"median {found.median_px:.2f} px, > 3 px {100 * found.far_off:.1f} %"
    return f"{labels}; disparity: density {found.density:.3f}, {off}"


if __name__ == "__main__":
    main()
