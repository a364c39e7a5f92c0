import json
import os
import shlex
import subprocess

import pytest
from click.testing import CliRunner

from semgrid_eval.bench import measurement
from semgrid_eval.bench.measurement import Settings
from semgrid_eval.bench.suite import PARTS, USUAL
from semgrid_eval.cli import bench
from semgrid_eval.cli.main import cli, main
from semgrid_eval.recording.colour import ImageSize

TINY = Settings(
    repeats=1,
    town_size_m=250.0,
    duration_s=15.0,
    scale=0.125,
    pictures_px=(ImageSize(64, 32), ImageSize(128, 64)),
    features=(2,),
    batch=2,
    updates=1,
    windows=4,
    matrix_rows=64,
    recordings=2,
    workers=1,
    trained_recordings=(20,),
    reported=(3, 2, 20),
)


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(measurement, "QUICK", TINY)


@pytest.mark.slow
def test_every_part_is_measured_printed_and_written(tiny, tmp_path):
    done = CliRunner().invoke(cli, ["bench", "--quick", "--json", str(tmp_path / "bench.json")])
    assert done.exit_code == 0, done.output
    conditions, *lines = done.stdout.splitlines()
    assert conditions.startswith("processor ")
    assert tuple(dict.fromkeys(line.split()[0] for line in lines)) == USUAL
    told = json.loads((tmp_path / "bench.json").read_text())
    assert len(told["measurements"]) == len(lines)
    assert all(row["value"] > 0.0 for row in told["measurements"] if row["unit"] != "s CPU")
    goals = {row["what"]: row["at_most"] or row["at_least"] for row in told["measurements"]}
    assert goals["semgrid-eval --help"] == 0.15
    assert goals["a frame projected and drawn, against NumPy"] == 15.0
    assert sum(" at most " in line or " at least " in line for line in lines) == sum(map(bool, goals.values()))
    assert {"torch", "eclipse-sumo", "cpu_cores"} <= told["conditions"].keys()


@pytest.mark.slow
def test_the_example_measures_the_parts_that_it_names(tiny):
    _, *arguments = shlex.split(bench.command.epilog.removeprefix("Example: "))
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    assert {line.split()[0] for line in done.stdout.splitlines()[1:]} == {"training", "prediction"}
    assert "f 2, against the textbook" in done.stdout
    assert "Not measured: a GPU" in done.stderr


@pytest.mark.slow
def test_memory_of_a_training_and_the_report_of_a_large_run_are_measured_when_asked_for(tiny, tmp_path):
    asked = ["bench", "--quick", "--only", "memory,report", "--json", str(tmp_path / "bench.json")]
    done = CliRunner().invoke(cli, asked)
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "bench.json").read_text())["measurements"]
    value = {row["what"]: row["value"] for row in rows}
    assert value["20 recordings, grids mapped"] == 20 * 30 * 128 * 128 / 2**20
    assert 200 < value["20 recordings, most anonymous memory"] < 2048
    assert 0.3 < value["20 recordings, against grids in memory"] < 3.0
    assert value["3 rows, 2 repeats, 20 recordings"] > 0.5
    assert value["3 rows, 2 repeats, 20 recordings, by the clock"] > 0.5
    assert 100 < value["3 rows, 2 repeats, 20 recordings, memory"] < 1024


def test_the_demo_is_measured_by_the_clock_with_its_own_command(tiny, monkeypatch):
    started, run = [], subprocess.run
    keep = lambda command, **given: started.append(command) if "demo" in command else run(command, **given)  # noqa: E731
    monkeypatch.setattr(subprocess, "run", keep)
    done = CliRunner().invoke(cli, ["bench", "--quick", "--only", "demo"])
    assert done.exit_code == 0, done.output
    (command,) = started
    assert CliRunner().invoke(cli, [*command[3:], "--no-such-option"]).output.count("No such option '--no-such-option'")
    assert "at most 180" in done.stdout


def test_a_busy_machine_is_a_warning(tiny, monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (99.0, 0.0, 0.0))
    done = CliRunner().invoke(cli, ["bench", "--quick", "--only", "prediction"])
    assert done.stderr.startswith("Warning: this machine has other work (load 99.0)")
    monkeypatch.setattr(os, "getloadavg", lambda: (0.1, 0.0, 0.0))
    done = CliRunner().invoke(cli, ["bench", "--quick", "--only", "prediction"])
    assert "Warning" not in done.stderr


def test_an_unknown_part_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(os, "getloadavg", lambda: (0.1, 0.0, 0.0))
    with pytest.raises(SystemExit) as stopped:
        main(["bench", "--only", "render,tranining"])
    assert stopped.value.code == 1
    error = capsys.readouterr().err
    assert error == f"Error: --only: 'tranining' is not one of {', '.join(PARTS)}; did you mean training?\n"
