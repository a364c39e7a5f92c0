"""Bad profiles of latency, and bad files of leads."""

import json
from pathlib import Path

from support.bad import matrices, small
from support.bad.case import Bad, Kind, lines, table
from support.bad.json_files import BROKEN, changed

PROFILE = {
    "format": 1,
    "made_by": {"command": "semgrid-eval latency logs", "version": "0.1.0", "machine": {"processor": "a quick one"}},
    "stages": {"decode": [4.0, 5.0, 60.0], "grid": [1.5, 1.25, 20.0]},
    "models": {"newest": [30.0, 31.0, 300.0]},
}
LEADS = {"lead_ms": {"mean_known": 250.0, "car": 300.0}}
PROFILES = r"""
format: 2
format: (gone)
made_by: (gone)
made_by: me
made_by: {command: (gone)}
made_by: {version: 1}
made_by: {machine: {cores: 2}}
stages: (gone)
stages: [1, 2, 3]
stages: {decode: (gone), grid: (gone)}
stages: {decode: []}
stages: {decode: 4}
stages: {decode: [4.0, -5.0, 60.0]}
stages: {decode: [4.0, 3600001.0, 60.0]}
stages: {decode: [4.0, slow, 60.0]}
stages: {decode: [4.0, .inf, 60.0]}
stages: {decode: [4.0, 5.0]}
stages: {decoed: [4.0, 5.0, 60.0]}
models: [newest]
models: {newest: [30.0, 31.0]}
models: {newest: []}
modells: {newest: [30.0, 31.0, 300.0]}
"""
PROFILE_BYTES = BROKEN | {line: changed(PROFILE, line) for line in lines(PROFILES)}
LEAD_LINES = r"""
lead_ms: (gone)
lead_ms: 250
lead_ms: {mean_known: soon}
lead_ms: {mean_known: (gone), car: (gone)}
lead_ms: {mean_known: (gone)}
lead_ms: {mean_known: 0}
lead_ms: {mean_known: 60001}
leads: {mean_known: 250}
"""
LEAD_BYTES = BROKEN | {line: changed(LEADS, line) for line in lines(LEAD_LINES)}
FROM_LEADS = matrices.row_text("model: newest, window: {lead_ms: from leads.json}")


def whole() -> None:
    """Write good logs, and a row that takes its latency from a profile."""
    small.whole()
    _rows("profile: profile.json")


def leads() -> None:
    """Write a row that takes its lead from a file."""
    matrices.whole()
    Path("bad.yaml").write_bytes(FROM_LEADS)
    Path("leads.json").write_text(json.dumps(LEADS))


def _rows(stream: str) -> None:
    Path("profile.json").write_text(json.dumps(PROFILE))
    Path("bad.yaml").write_bytes(small.matrix(f"model: newest, stream: {{{stream}}}"))


def _lead(words: str) -> Bad:
    return Bad(words, matrices.RUN, {"bad.yaml": matrices.row_text(words)})


KINDS = (
    Kind(
        "Profiles of latency",
        "What `profile.json` of a row with `stream: {profile: profile.json}` has otherwise than a good one.",
        whole,
        (
            *table(small.RUN, "profile.json", PROFILE_BYTES),
            Bad("no such file", small.RUN, spoil=lambda: Path("profile.json").unlink()),
            Bad(
                "stream: {profile: profile.json, profile_model: fuse}",
                small.RUN,
                spoil=lambda: _rows("profile: profile.json, profile_model: fuse"),
            ),
        ),
    ),
    Kind(
        "Leads",
        "What `leads.json` of a row with `lead_ms: from leads.json` has otherwise than a good one, or the row.",
        leads,
        (
            *table(matrices.RUN, "leads.json", LEAD_BYTES),
            _lead("model: newest, window: {lead_ms: from nowhere.json}"),
            _lead("model: newest, window: {lead_ms: 'from leads.json:bus'}"),
            _lead("model: newest, window: {lead_ms: 'from '}"),
            _lead("model: newest, window: {lead_ms: from logs}"),
        ),
    ),
)
