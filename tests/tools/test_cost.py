"""What costs what is measured at the least size: a table, the figures and a picture, which can be drawn again."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.toy_world import street

from semgrid_eval.log.store import write_log

TOOL = Path(__file__).parents[2] / "tools" / "cost.py"
STAGES = ["log written", "grids", "training, 1 updates", "prediction", "scoring"]


def call(*arguments):
    done = subprocess.run([sys.executable, TOOL, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_each_stage_is_measured_over_each_quantity_and_drawn(tmp_path):
    for number in range(2):
        recording = street(number, frames=24).recording(f"toy_{number:06}_000000", "train")
        write_log(recording, tmp_path / "logs" / f"toy{number}.mcap")
    said = call(tmp_path / "logs", "--out", tmp_path / "out", "--quick")
    assert re.findall(r"^\| ([a-z][^|]+?) \|", said, re.MULTILINE) == ["stage", *STAGES]
    found = json.loads((tmp_path / "out" / "cost.json").read_text())
    places = [(point["axis"], point[point["axis"]], point["stage"]) for point in found["points"]]
    axes = [("recordings", 1), ("recordings", 2), ("side", 32), ("side", 64)]
    assert places == [(*each, stage) for each in axes for stage in STAGES]
    assert all(point["cpu_s"] > 0 for point in found["points"])
    drawn = (tmp_path / "out" / "cost.svg").read_text()
    assert drawn.count("<svg") == 1
    assert "cells of a grid" in drawn
    assert call("--drawn", tmp_path / "out" / "cost.json", "--out", tmp_path / "again") == said
    assert (tmp_path / "again" / "cost.svg").read_text() == drawn


@pytest.mark.slow
def test_the_figures_of_the_page_are_those_that_are_kept(tmp_path):
    docs = TOOL.parents[1] / "docs"
    said = call("--drawn", docs / "cost.json", "--out", tmp_path)
    page = (docs / "performance.md").read_text()
    assert [line for line in said.splitlines() if line and line not in page] == []
    assert not re.search(r"e[+-][0-9]", said), "hours are written out"
    assert re.search(r"^\| `paper` \| [0-9]+ \| [0-9],[0-9]{3} h \|", said, re.MULTILINE)
