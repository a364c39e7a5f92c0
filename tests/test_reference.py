"""`make reference`: its commands are commands of the program, and its README tells what was done."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.fake_run import make_fake_run

from semgrid_eval.cli.main import cli
from semgrid_eval.report.page.write import write_report
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.row import plan_units

ROOT = Path(__file__).parents[1]


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_the_recipe_converts_runs_and_reports_in_folders_that_are_given(tmp_path):
    places = [f"REFERENCE={tmp_path}/work", f"REFERENCE_REPORT={tmp_path}/report", "READY=", "BIN=bin"]
    done = subprocess.run(["make", "-n", "reference", *places], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "; do bin/semgrid-eval $command || exit 1; done" in done.stdout
    commands = [shlex.split(command) for command in re.findall(r'"([^"]*)"', done.stdout)[:3]]
    assert [command[0] for command in commands] == ["convert", "run", "report"]
    assert commands[1][3] == commands[0][2] == f"{tmp_path}/work/logs"
    assert commands[2][1] == commands[1][5] == f"{tmp_path}/work/run"
    assert commands[2][3] == f"{tmp_path}/report"
    (tmp_path / "work" / "logs").mkdir(parents=True)
    for command in commands:
        result = CliRunner().invoke(cli, [*command, "--no-such-option"])
        assert "No such option '--no-such-option'" in result.output, result.output


def test_the_page_of_reports_names_the_preset_that_is_run_and_how_many_networks_it_trains():
    (preset,) = re.findall(r"^REFERENCE_MATRIX \?= (\S+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    units = plan_units(load_matrix(preset).rows, 0).values()
    networks = sum(unit.row.facts.learns and unit.row.facts.family in ("ED", "RN") for unit in units)
    text = " ".join((ROOT / "reports" / "README.md").read_text().split())
    assert f"runs the preset `{preset}` on it" in text
    assert f"networks are trained {networks} times" in text
    assert f": {networks} trainings" in (ROOT / "Makefile").read_text()


@pytest.mark.slow
def test_the_readme_names_commands_scores_and_verdicts(tmp_path):
    run = make_fake_run(tmp_path / "run")
    report = write_report([run], tmp_path / "report").parent
    tool = [sys.executable, ROOT / "tools" / "reference_readme.py"]
    subprocess.run([*tool, run, report, "run paper-cpu --logs L --out R"], check=True)
    text = (report / "README.md").read_text()
    assert "semgrid-eval run paper-cpu --logs L --out R\n" in text
    assert (report / "summary.md").read_text() in text
    assert "| ED-DC is better than BL-DC on static classes and vehicles | " in text
    assert "| trainings | " in text
