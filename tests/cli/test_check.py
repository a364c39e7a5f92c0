import json
import shlex

import pytest
from support.driving import driving

from semgrid_eval.cli.check import command
from semgrid_eval.cli.main import main
from semgrid_eval.log.store import write_log


def run(*arguments):
    """Run the command line and return its exit code."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return caught.value.code


@pytest.fixture
def logs(tmp_path):
    """A folder with a log that has warnings only."""
    write_log(driving(), tmp_path / "logs/val/a.mcap")
    return tmp_path / "logs"


def test_example_of_the_help_runs(logs, monkeypatch, capsys):
    monkeypatch.chdir(logs.parent)
    program, *arguments = shlex.split(command.epilog.removeprefix("Example: "))
    assert program == "semgrid-eval"
    assert run(*arguments) == 0
    said = capsys.readouterr()
    place = "logs/val/a.mcap: warning: /camera/front/label"
    assert f"{place}: is missing for 3 of 6 disparity images\n" in said.out
    assert said.err.endswith("1 logs checked, 0 with errors\n")


def test_damaged_log_gives_one_error_and_exit_code_1(logs, capsys):
    whole = (logs / "val/a.mcap").read_bytes()
    (logs / "val/b.mcap").write_bytes(whole[:-50])
    assert run("check", logs / "val/b.mcap") == 1
    said = capsys.readouterr().out
    assert said.startswith(f"{logs}/val/b.mcap: error: file: is damaged: its end is missing")
    assert said.count("\n") == 1
    assert run("check", logs / "val/a.mcap", logs) == 1


def test_json_holds_every_log_with_counts_and_findings(logs, capsys):
    (logs / "bad.mcap").write_bytes(b"no log")
    assert run("check", "--json", logs) == 1
    bad, good = json.loads(capsys.readouterr().out)
    assert (bad["good"], good["good"]) == (False, True)
    assert bad["findings"][0]["severity"] == "error"
    assert good["messages"]["/ego/motion"] == 6
    assert (bad["conditions"], good["conditions"]) == ({}, {})
    assert {finding["severity"] for finding in good["findings"]} == {"warning"}


def test_missing_log_is_a_mistake_of_the_user(logs, capsys):
    assert run("check", logs / "none.mcap") == 2
    assert "does not exist" in capsys.readouterr().err


def test_strict_refuses_what_is_worth_a_look(logs, capsys):
    assert run("check", logs) == 0
    assert run("check", "--strict", logs) == 1
    assert capsys.readouterr().err.endswith("1 logs checked, 1 with errors or warnings\n")
