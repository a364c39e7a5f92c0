"""Rows that are sound, and do not fit the logs that they are run on."""

from support.bad import small
from support.bad.case import Kind, lines, table

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
KIND = Kind(
    "Rows that do not fit the logs",
    "A row that is sound, run on logs of nine frames with one camera.",
    small.whole,
    table(small.RUN, "bad.yaml", {line: small.matrix(line) for line in [*lines(ROWS), f"{WATCHED}, {SMALL}"]}),
    shows_code=True,
)
