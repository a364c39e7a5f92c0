"""Bad matrices: whole files, and rows."""

from pathlib import Path

from support.bad.case import Kind, lines, table

RUN = "run bad.yaml --logs logs --out out"
_LOGS = Path("logs/val/empty.mcap")


def whole() -> None:
    """Make a folder of logs, which no bad matrix gets as far as to read."""
    _LOGS.parent.mkdir(parents=True)
    _LOGS.touch()


def file_text(text: str) -> bytes:
    """Return a matrix as it stands in the table: with `\\n` for a new line."""
    return text.replace("\\n", "\n").encode()


def row_text(text: str) -> bytes:
    """Return a matrix of one row with these settings."""
    name = "" if "name:" in text else "name: a, "
    return f"rows: [{{{name}{text}}}]\n".encode()


FILES = r"""
rows: []
title: no rows
[a, b]
just words
rows: 3
rows: [3]
rows: {a: {model: newest}}
titel: a\nrows: [{name: a, model: newest}]
title: 3\nrows: [{name: a, model: newest}]
seed: -1\nrows: [{name: a, model: newest}]
seed: 1.5\nrows: [{name: a, model: newest}]
seed: one\nrows: [{name: a, model: newest}]
seed: 9007199254740993\nrows: [{name: a, model: newest}]
models: [ed]\nrows: [{name: a, model: newest}]
models: {edd: {depth: 3}}\nrows: [{name: a, model: newest}]
models: {ed: 3}\nrows: [{name: a, model: ed}]
models: {ed: {depth: 9}}\nrows: [{name: a, model: ed}]
defaults: [1]\nrows: [{name: a, model: newest}]
defaults: {windw: {inputs: 2}}\nrows: [{name: a, model: newest}]
rows: [{name: a, model: newest}, {name: a, model: fuse}]
rows: [{name: a, model: newest}]\nwithout: [b]
extends: baselines\nwithout: [BL-DD]
extends: baselines\nwithout: BL-DC
extends: baselinse
extends: nowhere.yaml
extends: bad.yaml
extends: [baselines]
extends: baselines\nrows: [{name: BL-DC, modle: fuse}]
rows: [{model: newest}]
"""

LONG_FILES = {
    "a title of 201 characters": f"title: {'t' * 201}\nrows: [{{name: a, model: newest}}]",
}

ROWS = r"""
name: 3, model: newest
name: "", model: newest
modle: newest
model: newets
model: 3
model: [newest]
model: newest, settings: 3
model: newest, settings: {x: 1}
model: newest, setings: {}
model: newest, translate: perhaps
model: newest, mask_mode: exlude
model: newest, repeats: 0
model: newest, repeats: 1001
model: newest, repeats: 2.5
model: newest, train_split: 3
model: newest, validation_split: [val]
model: newest, hold_out: town03
model: newest, hold_out: [3]
model: newest, second_target: exact
model: newest, sensors: []
model: newest, sensors: full
model: newest, sensors: [ful]
model: newest, window: 3
model: newest, window: {inputs: 0}
model: newest, window: {inputs: 9}
model: newest, window: {step_frames: 0}
model: newest, window: {horizon_steps: 0}
model: newest, window: {horizon_step: 1}
model: newest, window: {target_frame: -1}
model: newest, window: {target_frame: last}
model: newest, window: {lead_ms: 0}
model: newest, window: {lead_ms: 60001}
model: newest, window: {lead_ms: soon}
model: newest, window: {lead_ms: 200, horizon_steps: 2}
model: newest, window: {inputs: 2}, validation_window: {inputs: 3}
model: newest, validation_window: 3
model: ed, train_leads: [5, 1]
model: ed, train_leads: [0, 3]
model: ed, train_leads: [1]
model: ed, train_leads: [1, 2, 3]
model: ed, train_leads: 5
model: ed, train_leads: [1, 30]
model: newest, grid: 3
model: newest, grid: {spec: 3}
model: newest, grid: {spec: {rows: 7}}
model: newest, grid: {spec: {columns: 1025}}
model: newest, grid: {spec: {cell_m: 0.01}}
model: newest, grid: {spec: {cell_m: 11}}
model: newest, grid: {spec: {cell_m: wide}}
model: newest, grid: {spec: {agent_row: 10000000000000000000000}}
model: newest, grid: {spec: {agent_row: -1}}
model: newest, grid: {spec: {agent_column: 300}}
model: newest, grid: {spec: {cell: 1}}
model: newest, grid: {target: []}
model: newest, grid: {target: [left]}
model: newest, grid: {target: [full, full]}
model: newest, grid: {integrator: eular}
model: newest, grid: {morphology: none}
model: newest, grid: {stretch_frames: 1}
model: newest, grid: {stretch_frames: 100001}
model: newest, grid: {class_map: {car: roadd}}
model: newest, grid: {class_map: {cat: road}}
model: newest, grid: {class_map: {car: 3}}
model: newest, grid: {class_map: [car]}
model: newest, grid: {sensors: [full]}
model: newest, grid: {sensors: {full: whole}}
model: newest, grid: {sensors: {full: {kind: radar}}}
model: newest, grid: {sensors: {full: {top: 3}}}
model: newest, grid: {sensors: {full: {top_px: -1}}}
model: newest, grid: {sensors: {full: {top_px: 256}}}
model: newest, grid: {sensors: {full: {bottom_px: 257}}}
model: newest, grid: {sensors: {full: {left_px: 12.5}}}
model: newest, grid: {sensors: {full: {image_size_px: [8, 8]}}}
model: newest, grid: {sensors: {full: {image_size_px: 512}}}
model: newest, grid: {sensors: {full: {image_size_px: [512, 256, 3]}}}
model: newest, grid: {sensors: {full: {exclude_border_px: 65}}}
model: newest, grid: {sensors: {full: {exclude_depth_step_px: 0}}}
model: newest, grid: {sensors: {full: {camera: 3}}}
model: newest, grid: {sensors: {"a+b": {}}}
model: newest, disturb: late_input
model: newest, disturb: {kind: late}
model: newest, disturb: {strength: 1}
model: newest, disturb: {kind: late_input, strength: 0}
model: newest, disturb: {kind: late_input, strength: 1.5}
model: newest, disturb: {kind: late_input, speed: 1}
model: newest, disturb: {kind: late_input, seed: -1}
model: newest, disturb: {kind: lost_frame, strength: 3}
model: newest, disturb: {kind: lost_frame, which: middle}
model: newest, disturb: {kind: lost_sensor, sensors: [rear]}
model: newest, disturb: {kind: lost_sensor, sensors: []}
model: newest, disturb: {kind: lost_sensor}
model: newest, disturb: {kind: mislabelled, strength: 1.1}
model: newest, disturb: {kind: mislabelled, patch_m: 0}
model: newest, disturb: {kind: reversed_order}, window: {inputs: 1}
model: newest, disturb: {kind: reversed_order, strength: 0}
model: newest, disturb: {kind: yaw_rate_bias, strength: 91}
model: ceiling, disturb: {kind: late_input}
model: log, settings: {folder: answers}, disturb: {kind: late_input}
model: log
model: log, settings: {folder: ""}
model: log, settings: {folder: answers, topic: ""}
model: true_motion, translate: false
model: overlay
model: overlay, settings: {top: ""}
model: overlay, sensors: [full, split1_lower]
model: overlay, sensors: [split1_upper, split1_upper]
model: ed, settings: {debth: 2}
model: ed, settings: {depth: 1}
model: ed, settings: {depth: 3.5}
model: ed, settings: {depth: 6}, grid: {spec: {columns: 80}}
model: ed, settings: {features: 3}
model: ed, settings: {features: 1024}
model: ed, settings: {decoder_activation: tanh}
model: ed, settings: {training: 3}
model: ed, settings: {training: {epochs: 0}}
model: ed, settings: {training: {updates_per_epoch: 0}}
model: ed, settings: {training: {epoch_unit: minutes}}
model: ed, settings: {training: {epoch_unit: windows, updates_per_epoch: 8, batch: 32}}
model: ed, settings: {training: {batch: 0}}
model: ed, settings: {training: {batch: 1000000000}}
model: ed, settings: {training: {precision: float8}}
model: ed, settings: {training: {clip_norm: 0}}
model: ed, settings: {training: {optimizer: {kind: sgd}}}
model: ed, settings: {training: {optimizer: {constants: jax}}}
model: ed, settings: {training: {schedule: {rate: 0.1}}}
model: ed, settings: {training: {schedule: {learning_rate: 0}}}
model: ed, settings: {training: {schedule: {learning_rate: fast}}}
model: ed, settings: {training: {schedule: {shape: step}}}
model: ed, settings: {training: {schedule: {drop_epoch: -1}}}
model: ed, settings: {training: {schedule: {rate_after_drop: 0}}}
model: ed, settings: {training: {schedule: {warm_up: 1}}}
model: ed, settings: {training: {loss: {jaccard: -1}}}
model: ed, settings: {training: {loss: {dice: 1}}}
model: ed, settings: {training: {augment: {flip: 1.5}}}
model: ed, settings: {training: {augment: {rotate_deg: -1}}}
model: ed, settings: {training: {augment: {misalign_cells: many}}}
model: ed, settings: {training: {calibrate: 2}}
model: residual, settings: {widths: []}
model: residual, settings: {widths: [8, 8, 8, 8, 8, 8, 8]}
model: residual, settings: {widths: [0]}
model: residual, settings: {fine: 257}
model: residual, settings: {shift: 9}
model: residual, settings: {lead_input: 1}
model: residual-flow, window: {inputs: 1}
model: residual-flow, settings: {flow: {overlap: 2}}
model: residual-town, window: {inputs: 3}
model: residual-town, translate: false
model: residual-town, grid: {spec: {cell_m: 0.5}}
model: residual-town, settings: {training: {epochs: 3}}
model: flow, settings: {speed_limit_mps: 101}
model: flow, settings: {small_speed_limit_mps: -1}
model: flow, settings: {least_cells: 0}
model: flow, settings: {least_motion_cells: 0}
model: flow, settings: {size_ratio: 1.1}
model: flow, settings: {overlap: -0.1}
model: flow, settings: {seen: 2}
model: flow, settings: {still_there: high}
"""

STREAMS = r"""
{}
3
{latency_ms: 80, latency: 3}
{latency_ms: -1}
{latency_ms: 60001}
{latency_ms: slow}
{latency_ms: 80, profile: whole.json}
{latency_ms: 80, recorded: true}
{recorded: true, rule: shrinking_tail}
{recorded: true}
{latency_ms: 80, scale: 2}
{profile: whole.json, scale: 0}
{latency_ms: 80, profile_model: fuse}
{profile: ""}
{latency_ms: 80, added_ms: -5}
{latency_ms: 80, workers: two}
{latency_ms: 80, workers: many, rule: shrinking_tail}
{latency_ms: 80, rule: oldest}
{latency_ms: 80, asked: later}
{latency_ms: 80, move: maybe}
{latency_ms: 80, rate_hz: 0}
{latency_ms: 80, rate_hz: 1001}
{latency_ms: 80, seed: -1}
"""

STREAM_ROWS = r"""
model: log, settings: {folder: answers}, stream: {latency_ms: 80}
model: newest, stream: {latency_ms: 80}, disturb: {kind: late_input}
model: newest, stream: {latency_ms: 80}, second_target: expected
model: ceiling, stream: {latency_ms: 80}
model: ed, stream: {latency_ms: 80}
model: ed, stream: {latency_ms: 80, asked: adaptive}
model: residual-town, stream: {latency_ms: 80, asked: fixed}, window: {lead_ms: 1500}
"""


FILE_BYTES = {line: file_text(line) for line in lines(FILES)} | {
    words: text.encode() for words, text in LONG_FILES.items()
}
ROW_BYTES = {line: row_text(line) for line in lines(ROWS)}
STREAM_BYTES = {line: row_text(f"model: newest, stream: {line}") for line in lines(STREAMS)} | {
    line: row_text(line) for line in lines(STREAM_ROWS)
}

MATRIX = Kind(
    "Matrices",
    "The whole of a matrix file, `bad.yaml`; `\\n` stands for a new line.",
    whole,
    table(RUN, "bad.yaml", FILE_BYTES),
    shows_code=True,
)
ROW = Kind(
    "Rows of a matrix",
    "A matrix `bad.yaml` with one row, `name: a` and what the table says.",
    whole,
    table(RUN, "bad.yaml", ROW_BYTES),
    shows_code=True,
)
STREAM = Kind(
    "Streams",
    "What `stream:` of a row is, or the row, in a matrix `bad.yaml` with one row.",
    whole,
    table(RUN, "bad.yaml", STREAM_BYTES),
    shows_code=True,
)
