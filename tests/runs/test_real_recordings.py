"""The known order of baselines on real recordings, where a folder of them is named by SEMGRID_REAL_DATA."""

import os
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from semgrid_eval.cli.main import cli
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.results import read_run, result_folder
from semgrid_eval.scores.sums import read_sums

REAL = os.environ.get("SEMGRID_REAL_DATA", "")
MATRIX = {
    "defaults": {"window": {"step_frames": 3, "target_frame": None}},
    "rows": [
        {"name": "BL-DC", "model": "newest"},
        {"name": "BL-NT", "model": "newest", "translate": False},
        {"name": "BL-Fuse", "model": "fuse"},
    ],
}


@pytest.mark.skipif(not Path(REAL, "camera").is_dir(), reason="SEMGRID_REAL_DATA names no Cityscapes tree")
def test_aligning_beats_repeating_and_fusing_beats_both(tmp_path):
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(MATRIX))
    steps = [
        ["convert", "cityscapes", REAL, f"{tmp_path}/logs", "--labels", f"{REAL}/pred_sequence", "--workers", "1"],
        ["run", f"{tmp_path}/m.yaml", "--logs", f"{tmp_path}/logs", "--out", f"{tmp_path}/run", "--workers", "1"],
    ]
    for arguments in steps:
        result = CliRunner().invoke(cli, arguments, standalone_mode=False)
        assert result.return_value == 0, result.output
    score = {}
    for row in read_run(tmp_path / "run").rows:
        counts = read_sums(result_folder(tmp_path / "run", row.results[0]), "iou", "all")[:, 0]
        score[row.name] = IOU.means(class_iou(counts.sum(axis=0)))["mean_known"]
    assert score["BL-Fuse"] > score["BL-DC"] > score["BL-NT"] + 0.02
