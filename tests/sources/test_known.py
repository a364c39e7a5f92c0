"""Sources as the command line finds them: each in the table, and one that a test adds in one file."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Literal

import pytest
from click.testing import CliRunner
from pydantic import Field
from support.driving import driving

from semgrid_eval.cli.main import cli
from semgrid_eval.config import Config
from semgrid_eval.errors import MissingExtraError
from semgrid_eval.log.convert import convert_recordings
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.sources.known import SOURCES, Known, Source, later, load_source


class BagOptions(Config):
    """What can be chosen of a folder of bags."""

    src: Path
    count: Annotated[int, Field(ge=1, description="How many.")] = 2
    kind: Literal["ros1", "ros2"] = "ros2"


def recordings_of(options):
    for number in range(options.count):
        yield replace(driving(), name=f"{options.src.name}{number}", dataset=options.kind, group=options.src.name)


def convert_bags(options, out, work):
    return convert_recordings(recordings_of(options), out, work)


BAGS = Source(BagOptions, convert_bags, help="Convert bags.", example="semgrid-eval convert bags SRC logs")


@pytest.fixture
def bags(monkeypatch, tmp_path):
    """Add the source of this file to the table, and go where a folder of bags is."""
    monkeypatch.setitem(sys.modules, "bags_of_test", SimpleNamespace(SOURCE=BAGS))
    monkeypatch.setitem(SOURCES, "bags", Known("bags_of_test:SOURCE", "Bags to logs."))
    monkeypatch.chdir(tmp_path)
    Path("drive").mkdir()


def convert(*arguments):
    return CliRunner().invoke(cli, ["convert", *arguments])


def test_a_source_in_the_table_is_a_command_with_the_options_of_its_fields(bags):
    assert re.search(r"\bbags +Bags to logs\.", convert("--help").output)
    done = convert("bags", "drive", "logs", "--count", "3", "--kind", "ros1")
    assert done.output.endswith("logs: 3 written, 0 up to date, 0 failed\n")
    with LogReader(find_logs(Path("logs"))[0]) as log:
        assert (log.scene.name, log.scene.dataset, log.scene.group) == ("drive0", "ros1", "drive")
    assert convert("bags", "drive", "logs").output.splitlines()[-1].startswith("Warning: logs holds 1 log beside those")


def test_limits_of_its_fields_are_checked(bags):
    assert "count: must be at least 1, not 0" in str(convert("bags", "drive", "logs", "--count", "0").exception)
    assert convert("bags", "elsewhere", "logs").output.endswith("Path 'elsewhere' does not exist.\n")


@pytest.mark.parametrize("name", SOURCES)
def test_every_source_says_what_its_command_does_and_how_it_is_used(name):
    source = load_source(name)
    assert source.example.startswith(f"semgrid-eval convert {name} ")
    for field in source.options.model_fields.values():
        assert field.description or field.is_required()
    assert f"Example: semgrid-eval convert {name}" in convert(name, "--help").output


def test_a_source_whose_package_is_missing_names_its_extra(monkeypatch):
    monkeypatch.setitem(SOURCES, "bags", Known("no_such_package:SOURCE", "Bags.", extra="bags"))
    with pytest.raises(MissingExtraError, match=r"no_such_package is not installed; .*semgrid-eval\[bags\]"):
        load_source("bags")
    assert "Bags." in convert("--help").output
    assert isinstance(convert("bags", "--help").exception, MissingExtraError)


def test_a_source_whose_package_is_needed_only_to_convert_has_its_help_without_it(bags, monkeypatch):
    source = replace(BAGS, convert=later("no_such_package:convert", extra="bags"))
    monkeypatch.setitem(sys.modules, "bags_of_test", SimpleNamespace(SOURCE=source))
    assert "--count" in convert("bags", "--help").output
    assert "pip install 'semgrid-eval[bags]'" in str(convert("bags", "drive", "logs").exception)


@pytest.mark.parametrize("module", ["sources.benchmarks", "sources.known", "report.page.write"])
def test_what_describes_the_town_needs_no_simulator(module):
    code = (
        f"import sys, semgrid_eval.{module}\n"
        "from semgrid_eval.sources.benchmarks import published_fingerprints\n"
        "assert len(published_fingerprints('town-v1/small')) == 420\n"
        "print([name for name in sys.modules if name.startswith(('semgrid_eval.sources.town', 'embreex'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
