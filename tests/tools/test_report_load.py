"""The tool that measures the report of a large run, with a small one."""

import re
import runpy
import sys

import pytest


@pytest.mark.slow
def test_a_report_of_every_row_and_repeat_is_timed(tmp_path, monkeypatch, capsys):
    options = ["--rows", "3", "--repeats", "2", "--windows", "20"]
    monkeypatch.setattr(sys, "argv", ["report_load.py", str(tmp_path / "run"), *options])
    runpy.run_path("tools/report_load.py", run_name="__main__")
    told = re.fullmatch(r"([\d.]+) s by the clock, ([\d.]+) s CPU, (\d+) MiB\n", capsys.readouterr().out)
    assert told
    assert float(told[2]) > 0.5
    assert 100 < int(told[3]) < 1024
    seeds = [line.split(",")[:2] for line in (tmp_path / "run" / "report" / "scores.csv").read_text().splitlines()[1:]]
    assert {row for row, _ in seeds} == {"BL-DC", "ED-1", "ED-2"}
