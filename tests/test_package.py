"""What the package says of itself, in one place each or the same in all."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import semgrid_eval

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(citation["version"]) == semgrid_eval.__version__
    assert citation["license"] == PROJECT["project"]["license"]
    (paper,) = citation["references"]
    assert [author["family-names"] for author in paper["authors"]] == ["Hoyer", "Kesper", "Khoreva", "Fischer"]
    assert paper["identifiers"][0]["value"] in PROJECT["project"]["urls"].values()


def test_files_that_contributing_names_are_there_and_so_are_its_targets():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = {word.strip("`,.;:()") for word in text.split() if ".py`" in word or ".md`" in word}
    assert len(named) > 5
    for name in named:
        assert name == "path.py:Class" or (ROOT / name).is_file(), name
    targets = {line.partition(":")[0] for line in (ROOT / "Makefile").read_text().splitlines() if ": $(READY)" in line}
    for line in text.splitlines():
        if line.startswith("make "):
            assert line.split()[1] in targets, line


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_line_for_completion_gives_a_script(shell):
    page = (ROOT / "docs" / "shell.md").read_text(encoding="utf-8")
    assert f"_SEMGRID_EVAL_COMPLETE={shell}_source semgrid-eval" in page
    environment = {**os.environ, "_SEMGRID_EVAL_COMPLETE": f"{shell}_source"}
    program = "from semgrid_eval.cli.main import cli; cli.main(prog_name='semgrid-eval')"
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert f"_SEMGRID_EVAL_COMPLETE={shell}_complete" in done.stdout
