import json
import re
import shlex
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest
import yaml
from support.damage import flipped, zeroed
from support.driving import driving

from semgrid_eval.cli.check import command
from semgrid_eval.cli.main import main
from semgrid_eval.config import parse_config
from semgrid_eval.executors import WorkerDied
from semgrid_eval.log.check import check_logs
from semgrid_eval.log.contract import Contract, TopicContract, contract_text
from semgrid_eval.log.default_contract import default_contract
from semgrid_eval.log.findings import MOST_FINDINGS
from semgrid_eval.log.quantities import quantities_of
from semgrid_eval.log.store import write_log

PAGE = (Path(__file__).parents[2] / "docs" / "check.md").read_text(encoding="utf-8")
SCHEMA = json.loads(files("semgrid_eval").joinpath("data/check.schema.json").read_text())


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
    place = "logs/val/a.mcap: warning: /camera/front/label: missing_beside"
    missing = "is missing (`semgrid-eval segment` adds it) for 3 of 6 messages of /camera/front/disparity"
    assert f"{place}: {missing} (allowed: at most 0)\n" in said.out
    assert said.err.endswith("1 log checked, 0 with errors\n")


def test_damaged_log_gives_one_error_and_exit_code_3(logs, capsys):
    whole = (logs / "val/a.mcap").read_bytes()
    (logs / "val/b.mcap").write_bytes(whole[:-50])
    assert run("check", logs / "val/b.mcap") == 3
    said = capsys.readouterr().out
    assert said.startswith(f"{logs}/val/b.mcap: error: file: is damaged: its end is missing")
    assert said.count("\n") == 1
    assert run("check", logs / "val/a.mcap", logs) == 3


def test_several_processes_find_the_same_in_the_same_order(logs, tmp_path, capsys):
    for name in "cb":
        write_log(driving(), logs / f"train/{name}.mcap")
    (tmp_path / "recording.yaml").write_text("topics: {/ego/motion: {rate_hz: {low: 50, severity: error}}}")
    found = {}
    for workers in (1, 2):
        assert run("check", "--workers", workers, "--spec", tmp_path / "recording.yaml", "--json", logs) == 1
        found[workers] = json.loads(capsys.readouterr().out)
    assert found[1] == found[2]
    assert [Path(each["log"]).name for each in found[2]["logs"]] == ["b.mcap", "c.mcap", "a.mcap"]


def test_a_log_that_takes_its_process_along_is_told(logs):
    class Dying:
        parallel, threads = 1, None

        def run(self, function, items):
            yield from reversed([(0, WorkerDied()), (1, function(items[1]))])

    first, second = check_logs([logs / "val/a.mcap"] * 2, None, Dying())
    assert not first.is_readable
    assert [str(each) for each in first.findings] == [f"error: file: {WorkerDied().reason}"]
    assert second.is_readable


def test_json_holds_every_log_with_counts_and_findings(logs, capsys):
    (logs / "bad.mcap").write_bytes(b"no log")
    assert run("check", "--json", logs) == 3
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, SCHEMA)
    bad, good = told["logs"]
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
    assert capsys.readouterr().err.endswith("1 log checked, 1 with errors or warnings\n")


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


def test_a_contract_of_ones_own_is_held(logs, tmp_path, capsys):
    (tmp_path / "recording.yaml").write_text("topics:\n  /ego/motion:\n    rate_hz: {low: 50, severity: error}\n")
    assert run("check", logs, "--spec", tmp_path / "recording.yaml") == 1
    assert (
        capsys.readouterr().out == f"{logs}/val/a.mcap: error: /ego/motion: rate_hz: is 17 Hz (allowed: at least 50)\n"
    )


def test_the_printed_contract_is_the_default_one(logs, tmp_path, capsys):
    assert run("check", "--print-spec") == 0
    printed = capsys.readouterr().out
    assert printed == contract_text(default_contract())
    (tmp_path / "recording.yaml").write_text(printed)
    said = []
    for options in ((), ("--spec", tmp_path / "recording.yaml")):
        run("check", logs, *options)
        said.append(capsys.readouterr().out)
    assert said[0] == said[1] != ""


def test_a_bad_contract_is_one_line(logs, tmp_path, capsys):
    (tmp_path / "recording.yaml").write_text("topics: {/ego/motion: {rate_hz: {low: fast}}}")
    assert run("check", logs, "--spec", tmp_path / "recording.yaml") == 1
    said = capsys.readouterr()
    assert said.out == ""
    place = f"{tmp_path}/recording.yaml: topics./ego/motion.rate_hz.low"
    assert said.err == f"Error: {place}: must be a number, not 'fast'\n"


def test_more_findings_than_anybody_reads_are_counted(logs, tmp_path, capsys):
    limits = "\n".join(f"  /none/{number}: {{messages: {{low: 1}}}}" for number in range(MOST_FINDINGS + 7))
    (tmp_path / "recording.yaml").write_text(f"topics:\n{limits}\n  /more: {{messages: {{low: 1, severity: error}}}}\n")
    assert run("check", logs, "--spec", tmp_path / "recording.yaml") == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == MOST_FINDINGS + 1
    assert "error: /more" in lines[0]
    assert lines[-1] == f"{logs}/val/a.mcap: and 8 more findings"
    assert run("check", "--json", logs, "--spec", tmp_path / "recording.yaml") == 1
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, SCHEMA)
    assert told["logs"][0]["more_findings"] == 8


@pytest.fixture
def damaged(logs):
    """The same folder with three more logs: one cut, one with a damaged chunk, one of nothing but zeros."""
    whole = (logs / "val/a.mcap").read_bytes()
    (logs / "val/cut.mcap").write_bytes(whole[: len(whole) // 2])
    (logs / "val/flipped.mcap").write_bytes(flipped(whole, len(whole) // 2))
    (logs / "zeros.mcap").write_bytes(zeroed(whole, 0, len(whole)))
    return logs


def test_what_is_whole_is_saved_and_what_is_lost_is_told(damaged, tmp_path, capsys):
    assert run("check", damaged, "--recover", tmp_path / "out") == 3
    said = capsys.readouterr()
    assert f"{damaged}/val/a.mcap: is whole: " in said.out
    assert f"{damaged}/val/cut.mcap: lost: how many messages is not known\n" in said.out
    assert f"{damaged}/val/flipped.mcap: lost: bytes " in said.out
    assert f"{damaged}/zeros.mcap: not recovered: holds no message that can be saved\n" in said.out
    assert "3 logs saved, 2 of them with losses; 1 could not be saved\n" in said.err
    assert sorted(path.name for path in (tmp_path / "out/val").iterdir()) == ["a.mcap", "cut.mcap", "flipped.mcap"]
    assert run("check", tmp_path / "out") == 0


def test_a_new_log_that_cannot_be_written_is_told_and_the_others_are_saved(damaged, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/val").touch()
    whole = (damaged / "val/a.mcap").read_bytes()
    (damaged / "zeros.mcap").write_bytes(whole)
    assert run("check", damaged, "--recover", tmp_path / "out") == 3
    said = capsys.readouterr().out
    assert f"{damaged}/val/cut.mcap: not recovered: {tmp_path}/out/val/cut.mcap: cannot be written: " in said
    assert (tmp_path / "out/zeros.mcap").read_bytes() == whole


def test_exit_codes_and_json_of_a_recovery(damaged, tmp_path, capsys):
    assert run("check", damaged / "val/a.mcap", "--recover", tmp_path / "whole") == 0
    capsys.readouterr()
    assert run("check", damaged / "val", "--recover", tmp_path / "out", "--json") == 1
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, SCHEMA)
    assert [each["recovery"]["is_whole"] for each in told["recoveries"]] == [True, False, False]
    assert told["recoveries"][1]["recovery"]["lost"] is None
    assert all(each["readable"] for each in told["logs"])
    assert run("check", damaged, "--recover", tmp_path / "third", "--json") == 3
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, SCHEMA)
    assert told["recoveries"][-1]["recovery"] is None


def test_nothing_is_overwritten_by_a_recovery(damaged, tmp_path, capsys):
    before = (damaged / "val/cut.mcap").read_bytes()
    assert run("check", damaged, "--recover", damaged) == 1
    assert "is there already, and nothing is overwritten\n" in capsys.readouterr().err
    assert (damaged / "val/cut.mcap").read_bytes() == before
    twice = (damaged / "val/a.mcap", damaged / "val")
    assert run("check", *twice, "--recover", tmp_path / "out") == 1  # all are done but for the losses
    (damaged / "a.mcap").write_bytes(before)
    assert run("check", damaged / "a.mcap", damaged / "val", "--recover", tmp_path / "new") == 1
    assert "two logs have this name" in capsys.readouterr().err


def test_commands_and_contract_of_the_page_are_sound(logs, monkeypatch):
    monkeypatch.chdir(logs.parent)
    Path("recording.yaml").touch()
    shown = re.search(r"```sh\n(.*?)```", PAGE, re.DOTALL)[1].splitlines()
    assert len(shown) == 4
    for line in shown:
        command.make_context("check", shlex.split(line)[2:])
    (contract,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert len(parse_config(Contract, yaml.safe_load(contract)).latencies) == 2


def test_the_page_names_every_field_and_value():
    names = {*Contract.model_fields, *TopicContract.model_fields} - {"topics"}
    topics = ("/ego/motion", *(f"/camera/NAME/{each}" for each in ("calibration", "stereo", "disparity", "label")))
    values = {name for topic in topics for name in quantities_of(topic)}
    told = re.findall(r"`(?:topics\.TOPIC\.|\.\.\. )?([^`]*)`", PAGE)
    assert (names | values) - {"values"} <= {part for each in told for part in (each, each.removeprefix("... "))}
    for topic in topics:
        assert f"| `{topic}` |" in PAGE
