"""Rows that are sound, and do not fit the logs that they are run on."""

from pathlib import Path

from support.bad import small
from support.bad.case import Kind, lines, table
from support.single import single_rig

from semgrid_eval.log.store import write_log

ROWS = r"""
model: newest, window: {step_frames: 5}
model: newest, window: {step_frames: 3, target_frame: 9}
model: newest, window: {inputs: 5, step_frames: 3, target_frame: null}
model: newest, window: {step_frames: 3, target_frame: 8, lead_ms: 400}
model: newest, validation_split: test
model: ed, train_split: test
model: newest, hold_out: [town03]
model: residual-town, window: {step_frames: 3, target_frame: null, lead_ms: 1300}
model: newest, window: {inputs: 12, step_frames: 1, target_frame: null}, stream: {latency_ms: 50}
"""
SMALL = "settings: {features: 4, depth: 2, training: {epochs: 1, updates_per_epoch: 1, batch: 2}}"
WATCHED = "model: ed, window: {step_frames: 3, target_frame: 7, lead_ms: 300}, stream: {latency_ms: 50, asked: fixed}"
SINGLE_ROWS = r"""
model: newest
model: newest, grid: {sensors: {a: {camera: left}}, target: [a]}
model: newest, grid: {sensors: {a: {kind: lidar, colour_from: {camera: left}}, b: {camera: right}}, target: [a]}
"""


def _single() -> None:
    """Write a log for each split."""
    for seed, split in enumerate(("train", "val")):
        write_log(single_rig(frames=18, seed=seed, split=split), Path("logs", split, f"rig{seed}.mcap"))


FITTING = Kind(
    "Rows that do not fit the logs",
    "A row that is sound, run on logs of nine frames with one camera.",
    small.whole,
    table(small.RUN, "bad.yaml", {line: small.matrix(line) for line in [*lines(ROWS), f"{WATCHED}, {SMALL}"]}),
    shows_code=True,
)
SINGLE = Kind(
    "Rows on logs of cameras without disparity",
    "A row that is sound, run on logs of nine sweeps of a LiDAR without labels, beside two cameras without disparity.",
    _single,
    table(small.RUN, "bad.yaml", {line: small.matrix(line) for line in lines(SINGLE_ROWS)}),
    shows_code=True,
)
KINDS = (FITTING, SINGLE)
