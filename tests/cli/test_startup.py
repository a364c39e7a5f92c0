"""What a command imports before it works: help and versions wait for no heavy package."""

import json
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


def test_completion_of_names_imports_no_command(monkeypatch):
    for key, value in (
        ("_SEMGRID_EVAL_COMPLETE", "bash_complete"),
        ("COMP_WORDS", "semgrid-eval re"),
        ("COMP_CWORD", "1"),
    ):
        monkeypatch.setenv(key, value)
    program = (
        "import sys\nfrom semgrid_eval.cli.main import cli\n"
        "try:\n    cli.main(prog_name='semgrid-eval')\n"
        "finally:\n    print(sorted(name for name in sys.modules if name == 'semgrid_eval.cli.report'))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["plain,report", "[]"]


def test_every_command_is_listed_with_a_short_line_that_its_help_does_not_repeat():
    shown = CliRunner().invoke(cli, ["--help"]).output.splitlines()
    for name, text in COMMANDS.items():
        assert any(line.split(maxsplit=1) == [name, text] for line in shown)
        assert text not in CliRunner().invoke(cli, [name, "--help"]).output
