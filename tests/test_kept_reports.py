"""Reports that are kept: their commands are commands of the program, and their READMEs tell what was done."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.cli.main import cli
from semgrid_eval.report.page.write import write_report
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.row import plan_units

ROOT = Path(__file__).parents[1]


PRESETS = dict(re.findall(r"^PRESET_(\w+) := (\S+)$", (ROOT / "Makefile").read_text(), re.MULTILINE))


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
@pytest.mark.parametrize("name", PRESETS)
def test_the_recipe_converts_runs_and_reports_in_folders_that_are_given(name, tmp_path):
    places = [f"KEPT={tmp_path}/kept", f"KEPT_REPORTS={tmp_path}/reports", "READY=", "BIN=bin"]
    done = subprocess.run(["make", "-n", name, *places], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "; do bin/semgrid-eval $command || exit 1; done" in done.stdout
    commands = [shlex.split(command) for command in re.findall(r'"([^"]*)"', done.stdout)[:3]]
    assert [command[0] for command in commands] == ["convert", "run", "report"]
    assert commands[1][1] == PRESETS[name]
    assert commands[1][3] == commands[0][2] == f"{tmp_path}/kept/logs"
    assert commands[2][1] == commands[1][5] == f"{tmp_path}/kept/{name}"
    assert commands[2][3] == f"{tmp_path}/reports/{name}"
    (tmp_path / "kept" / "logs").mkdir(parents=True)
    for command in commands:
        result = CliRunner().invoke(cli, [*command, "--no-such-option"])
        assert "No such option '--no-such-option'" in result.output, result.output


@pytest.mark.parametrize("name", PRESETS)
def test_the_page_of_reports_says_how_many_networks_are_trained(name):
    units = plan_units(load_matrix(PRESETS[name]).rows, 0).values()
    networks = sum(unit.row.facts.learns and unit.row.facts.family in ("ED", "RN") for unit in units)
    text = (ROOT / "reports" / "README.md").read_text()
    assert re.search(rf"^\| .*`{name}`.* \| `{PRESETS[name]}` \| {networks} \|", text, re.MULTILINE)


@pytest.mark.slow
def test_the_readme_names_commands_scores_and_verdicts(tmp_path):
    run = make_fake_run(tmp_path / "run")
    report = write_report([run], tmp_path / "report").parent
    tool = [sys.executable, ROOT / "tools" / "report_readme.py"]
    subprocess.run([*tool, run, report, "run paper-cpu --logs L --out R"], check=True)
    text = (report / "README.md").read_text()
    assert "A report made by `make report`;" in text
    assert "semgrid-eval run paper-cpu --logs L --out R\n" in text
    assert (report / "summary.md").read_text() in text
    assert "| ED-DC is better than BL-DC on static classes and vehicles | " in text
    assert "| trainings | " in text
    assert "| not run |" not in text


@pytest.mark.slow
def test_rows_that_change_one_choice_are_held_against_those_that_change_none(tmp_path):
    rows = (
        FakeRow("default", "BL", 0.15),
        FakeRow("Sp2", "BL", 0.2),
        FakeRow("Sp2-lower", "BL", 0.1),
        FakeRow("arc", "BL", 0.3),
        FakeRow("fine", "BL", 0.3, cell_m=0.39),
        FakeRow("default", "ED", 0.1, 1),
        FakeRow("relu", "ED", 0.1, 1, same_as="ED-default"),
    )
    run = make_fake_run(tmp_path / "run", rows=rows)
    report = write_report([run], tmp_path / "report").parent
    subprocess.run([sys.executable, ROOT / "tools" / "report_readme.py", run, report, "run x"], check=True)
    _, _, text = (report / "README.md").read_text().partition("## Each choice against the default")
    lines = [line.split(" | ") for line in text.strip().splitlines()[2:]]
    minus = "\N{MINUS SIGN}"
    pairs = [
        "BL-Sp2 BL-default",
        "BL-Sp2-lower BL-Sp2",
        "BL-arc BL-default",
        "BL-fine BL-default",
        "ED-relu ED-default",
    ]
    assert [line[0].removeprefix("| ").replace(f" {minus} ", " ") for line in lines] == pairs
    assert lines[1][1].startswith("+")
    assert lines[4][1] == "+0.000 (+0.000 to +0.000)"
    assert lines[3][1].endswith(", other targets")
    assert re.fullmatch(r"[+-]0\.\d{3} \([+-]0\.\d{3} to [+-]0\.\d{3}\)", lines[0][1])
