"""What a command imports before it works: help and versions wait for no heavy package."""

import json
import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

from semgrid_eval.cli.main import COMMANDS, cli
from semgrid_eval.sources.known import SOURCES

HEAVY = {
    *("cv2", "embreex", "google", "jinja2", "matplotlib", "mcap", "numba", "numpy", "onnxruntime", "pandas", "PIL"),
    *("ray", "rich", "safetensors", "scipy", "sumo", "torch", "trimesh"),
}
OF_SETTINGS = {"pydantic", "yaml"}
"""Needed where options are the fields of a configuration."""
PROGRAM = """
import json
import sys
from semgrid_eval.cli.main import main
try:
    main(sys.argv[1:])
finally:
    print(json.dumps(sorted(name for name in sys.modules if "." not in name)))
"""


def imported(*arguments):
    """Run the command line in a fresh process; return what it says, and the packages that it has imported."""
    command = [sys.executable, "-c", PROGRAM, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    *said, packages = done.stdout.splitlines()
    return said, set(json.loads(packages))


@pytest.mark.parametrize(
    "arguments", [("--help",), ("--version",), ("convert", "--help"), *((name, "--help") for name in COMMANDS)]
)
def test_help_and_version_wait_for_no_heavy_package(arguments):
    said, packages = imported(*arguments)
    assert said
    made_of_settings = arguments[0] in ("segment", "latency")
    assert packages & (HEAVY if made_of_settings else HEAVY | OF_SETTINGS) == set()


@pytest.mark.parametrize("name", SOURCES)
def test_the_help_of_a_source_waits_for_settings_alone(name):
    said, packages = imported("convert", name, "--help")
    assert f"Example: semgrid-eval convert {name}" in "\n".join(said)
    assert packages & HEAVY == set()


def completed(words, watched):
    """Complete the last of some words as bash asks: the lines, and which of the watched modules were imported."""
    asked = {"_SEMGRID_EVAL_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    program = (
        "import sys\nfrom semgrid_eval.cli.main import cli\n"
        "try:\n    cli.main(prog_name='semgrid-eval')\n"
        f"finally:\n    print(sorted({watched} & sys.modules.keys()))"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | asked)
    return done.stdout.splitlines()


def test_completion_of_names_imports_no_command():
    assert completed("semgrid-eval re", {"semgrid_eval.cli.report"}) == ["plain,report", "[]"]


def test_a_matrix_is_completed_to_a_preset_or_else_a_file_without_waiting_for_torch():
    assert completed("semgrid-eval run ref", HEAVY | OF_SETTINGS) == ["plain,reference", "[]"]
    assert completed("semgrid-eval run my_ma", HEAVY | OF_SETTINGS) == ["file,my_ma", "[]"]


def test_every_command_is_listed_with_a_short_line_that_its_help_does_not_repeat():
    shown = CliRunner().invoke(cli, ["--help"]).output.splitlines()
    for name, text in COMMANDS.items():
        assert any(line.split(maxsplit=1) == [name, text] for line in shown)
        assert text not in CliRunner().invoke(cli, [name, "--help"]).output
