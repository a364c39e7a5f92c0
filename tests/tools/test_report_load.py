"""The tool that measures the report of a large run, with a small one."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "report_load.py"


@pytest.mark.slow
def test_a_report_of_every_row_and_repeat_is_timed(tmp_path):
    options = ["--rows", "3", "--repeats", "2", "--windows", "20"]
    command = [sys.executable, TOOL, tmp_path / "run", *options]  # apart, since memory is the most of all children
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    told = re.fullmatch(r"([\d.]+) s by the clock, ([\d.]+) s CPU, (\d+) MiB\n", done.stdout)
    assert told
    assert float(told[2]) > 0.5
    assert 100 < int(told[3]) < 1024
    seeds = [line.split(",")[:2] for line in (tmp_path / "run" / "report" / "scores.csv").read_text().splitlines()[1:]]
    assert {row for row, _ in seeds} == {"BL-DC", "ED-1", "ED-2"}
