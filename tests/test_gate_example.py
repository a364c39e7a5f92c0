"""The workflow of the page on gates: its commands run, hold what stays the same, and fail what has got worse."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.towns import SMALL, town_cache

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "gate"
PAGE = (ROOT / "docs" / "gate.md").read_text(encoding="utf-8")
WORSE = "batch.past[:, 0, -1].roll(9, dims=-1)"  # nine cells beside where it is
LOGS = {**SMALL, "recordings": 12, "val_share": 0.5, "width": 128, "height": 64}


def steps():
    """The steps of the workflow that run commands, by their names."""
    job = yaml.safe_load((EXAMPLE / "gate.yml").read_text(encoding="utf-8"))["jobs"]["gate"]
    return {step["name"]: step for step in job["steps"] if "run" in step}


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """A machine of the workflow: two checkouts, the command on its path, and smaller logs than it asks for."""
    folder = tmp_path_factory.mktemp("gate")
    (folder / "bin").mkdir()
    command = folder / "bin" / "semgrid-eval"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m semgrid_eval "$@"\n')
    command.chmod(0o755)
    for name in ("before", "after"):
        shutil.copytree(EXAMPLE, folder / name)
    model = folder / "after" / "mine.py"
    model.write_text(model.read_text().replace("batch.past[:, 0, -1]", WORSE))
    return folder


def run(step, workplace):
    options = " ".join(f"--{name.replace('_', '-')} {value}" for name, value in LOGS.items())
    path = os.pathsep.join((str(workplace / "bin"), os.environ["PATH"]))
    packages = os.pathsep.join((str(ROOT), os.environ.get("PYTHONPATH", "")))
    environment = {**os.environ, "PATH": path, "PYTHONPATH": packages, "DRIVES": f"{options} --cache {town_cache()}"}
    bash = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]  # as GitHub runs a step
    folder = workplace / step.get("working-directory", ".")
    return subprocess.run(bash, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_workflow_fails_a_model_that_got_worse_and_holds_the_one_that_did_not(workplace):
    commands = steps()
    assert list(commands) == ["install", "logs", "before", "after", "gate"]
    for name in ("logs", "before", "after"):
        done = run(commands[name], workplace)
        assert done.returncode == 0, done.stderr
    failed = run(commands["gate"], workplace)
    assert failed.returncode == 1
    below = re.findall("^Error: gate: mine, (.*): .* is clearly below", failed.stderr, re.MULTILINE)
    assert "mean_known" in below
    assert re.search(r"mine, vehicles: -0\.[0-9]+ ", failed.stderr)
    assert (workplace / failed.stdout.strip()).is_file()
    shutil.copytree(workplace / "runs" / "before", workplace / "runs" / "after", dirs_exist_ok=True)
    held = run(commands["gate"], workplace)
    assert held.returncode == 0, held.stderr


def test_the_page_shows_what_the_workflow_runs():
    shown = re.findall(r"```sh\n(semgrid-eval report .*)\n```", PAGE)
    assert len(shown) == 1
    for part in shown[0].split("--"):
        assert part.strip() in steps()["gate"]["run"]
    for path in re.findall(r"\]\(\.\./([^)]+)\)", PAGE):
        assert (ROOT / path).exists()
