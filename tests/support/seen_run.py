"""A real run on toy streets, whose logs give camera images: several horizons, and sensors with a blind band."""

import json
from pathlib import Path

from support.toy_world import street

from semgrid_eval.log.store import write_log
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix

SPLIT = ["split2_upper", "split2_lower"]
STEP_FRAMES, TARGET_FRAME = 2, 8
MODEL = """
import torch


from semgrid_eval.models.model import Model


class Fill(Model):
    files = ()

    def predict(self, batch):
        newest, older = batch.past[:, :, -1].amax(dim=1), batch.past[:, :, 0].amax(dim=1)
        known = torch.where(newest > 0, newest, older)
        known = torch.where(known > 0, known, torch.ones_like(known))
        scores = torch.nn.functional.one_hot(known.long(), 10).permute(0, 3, 1, 2).float()
        return scores * torch.where(older > 0, 1.0, 0.6)[:, None]
"""


def make_seen_run(folder: Path) -> Path:
    """Write logs and a run of two recordings below a folder and return the run's folder; the first drive turns."""
    for i, yaw_rate_radps in enumerate((0.5, 0.0)):
        world = street(i, frames=TARGET_FRAME + 1, yaw_rate_radps=yaw_rate_radps, noise_px=0.02)
        write_log(world.recording(f"toy{i}"), folder / "logs" / "val" / f"toy{i}.mcap")
    model = folder / "fill.py"
    model.write_text(MODEL)
    rows = [
        {"name": "BL-DC", "model": "newest"},
        {"name": "BL-PH1", "model": "newest", "window": {"horizon_steps": 2}},
        {"name": "BL-Sp2", "model": "overlay", "sensors": SPLIT},
        {"name": "own-DC", "model": f"{model}:Fill"},
        {"name": "own-PH2", "model": f"{model}:Fill", "window": {"horizon_steps": 3}},
        {"name": "own-PH1", "model": f"{model}:Fill", "window": {"horizon_steps": 2}},
        {"name": "own-Sp2", "model": f"{model}:Fill", "sensors": SPLIT},
    ]
    matrix = folder / "matrix.yaml"
    window = {"step_frames": STEP_FRAMES, "target_frame": TARGET_FRAME}
    matrix.write_text(json.dumps({"title": "Seen", "defaults": {"window": window}, "rows": rows}))
    command = "semgrid-eval run m.yaml --logs 'my logs' --out=runs/seen --jobs 2"
    run_matrix(load_matrix(str(matrix)), folder / "logs", folder / "run", RunOptions("cpu", folder / "grids", command))
    return folder / "run"
