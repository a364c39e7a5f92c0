"""The worked example of docs/predictions.md runs, and its rows score what it writes."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from support import page_runs
from support.pages import blocks, text_of
from support.small_runs import run
from support.toy_world import street

from semgrid_eval.log.store import write_log
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums

PAGE = text_of("docs/predictions.md")


@pytest.mark.slow
def test_the_example_writes_logs_that_its_rows_score(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(street(1, frames=27, speed_mps=12.0).recording("toy", "train"), Path("logs/train/toy.mcap"))
    write_log(street(2, frames=27, speed_mps=12.0).recording("drive", "val"), Path("logs/val/drive.mcap"))
    node, export = blocks("python", PAGE)
    Path("node.py").write_text(node)
    for folder in ("predictions", "runs"):
        Path(folder).mkdir()
    monkeypatch.setattr(sys, "argv", ["node.py", "logs", "predictions"])
    runpy.run_path("node.py")
    assert sorted(path.name for path in Path("predictions").iterdir()) == ["drive.mcap", "toy.mcap"]
    rows = yaml.safe_load(blocks("yaml", PAGE)[0])["rows"]
    rows += [{"name": "BL-DC", "model": "newest"}, {"name": "BL-NT", "model": "newest", "translate": False}]
    window = {"step_frames": 5, "target_frame": 25}
    record = run(rows, Path("logs"), tmp_path / "runs" / "first", window=window)
    assert [row.failure for row in record.rows] == [None] * 4
    scored = {row.name: results.result_folder(tmp_path / "runs/first", row.results[0]) for row in record.rows}
    stream = results.read_result(scored["NODE-live"]).stream
    assert (stream.latency_ms, stream.lead_ms, stream.misses) == (90.0, 300.0, 3)
    counts = {name: read_sums(folder, "iou", "all") for name, folder in scored.items()}
    np.testing.assert_array_equal(counts["NODE"], counts["BL-DC"])  # straight on at one speed, it expects the way
    assert (counts["NODE"] != counts["BL-NT"]).any()
    exec(export, {})
    assert [path.name for path in Path("exported").iterdir()] == ["drive.mcap"]
    page_runs.run("docs/predictions.md")
    assert Path("live.mcap").is_file()
