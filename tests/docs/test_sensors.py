"""What docs/sensors.md shows is run on small pictures, and its table of sensors is that of the code."""

import math
import re
import shlex
from pathlib import Path

import pytest
from support.commands import run_command
from support.pages import commands, text_of
from support.towns import town_cache

from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.sources.town.picture_errors import LIDAR
from semgrid_eval.sources.town.rig import CLOCKS, RIGS, ROOF, SIDES

PAGE = text_of("docs/sensors.md")
CONVERT, CHECK, _, RUN, REPORT = (line for line in commands(PAGE) if line.startswith("semgrid-eval "))


@pytest.mark.slow
def test_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    small = ["--width", "64", "--height", "32", "--workers", "1", "--cache", str(town_cache())]
    for line, more in ((CONVERT, small), (CHECK, []), (RUN, ["--row", "BL-*"]), (REPORT, [])):
        ended = run_command([*shlex.split(line)[1:], *more])
        assert ended.code == 0, f"{line}\n{ended.err}"
    assert (
        "Targets are what front, left, right, rear and lidar have measured together"
        in Path("RUN/report/index.html").read_text()
    )
    (run,) = load_runs([Path("RUN")])
    assert {row.name for row in run.rows if row.results} == {
        row.name for row in load_matrix("sensors").rows if row.name.startswith("BL-")
    }


@pytest.mark.parametrize("sensor", CLOCKS)
def test_the_table_of_sensors_is_that_of_the_code(sensor):
    (line,) = re.findall(rf"^\| `{sensor}` \|(.+)\|$", PAGE, re.MULTILINE)
    place, looks, _, _, clock = (cell.strip() for cell in line.split("|"))
    where = ROOF.place_m if sensor == LIDAR else SIDES[sensor].place_m
    assert tuple(map(float, place.split(", "))) == where
    if sensor != LIDAR:
        assert float(looks.split()[0]) == pytest.approx(math.degrees(SIDES[sensor].yaw_rad))
    assert clock == f"{CLOCKS[sensor].rate_hz:g} Hz, {1000 * CLOCKS[sensor].offset_s:g} ms"


def test_the_table_of_rigs_is_that_of_the_code():
    table, _ = PAGE.split("## The sensors")
    for rig, sensors in RIGS.items():
        (line,) = re.findall(rf"^\| `{re.escape(rig)}`(?: \(the default\))? \|(.+)\|$", table, re.MULTILINE)
        assert tuple(re.findall(r"`(\w+)`", line)) == sensors
