import shlex

import pytest
from click.testing import CliRunner
from support.toy_world import street

from semgrid_eval.cli import latency
from semgrid_eval.cli.main import cli, main
from semgrid_eval.log.store import write_log
from semgrid_eval.streams.profile import LatencyProfile, read_profile


@pytest.fixture
def logs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(street(1, frames=12).recording("toy"), tmp_path / "logs" / "val" / "toy.mcap")
    return tmp_path


def test_the_example_measures_a_log(logs):
    _, *arguments = shlex.split(latency.command.epilog.removeprefix("Example: "))
    done = CliRunner().invoke(cli, [*arguments, "--warm-up", "2"])
    assert done.exit_code == 0, done.output
    profile = read_profile(logs / "profile.json")
    assert profile.frames == 5
    assert list(profile.models) == ["fuse"]
    machine, heads, *rows = done.stdout.splitlines()
    assert machine.startswith("processor ")
    assert heads.split() == ["ms", "median", "99", "%", "most", "with", "fuse"]
    assert [row.split()[0] for row in rows] == ["decode", "grid", "align", "fuse", "whole"]
    assert sum(float(row.split()[-1].rstrip("%")) for row in rows[:-1]) == pytest.approx(100.0, abs=0.3)


def test_random_weights_are_said(logs):
    arguments = ["latency", "logs", "--model", "ed", "--frames", "1", "--warm-up", "0", "--out", "profile.json"]
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    assert "ed has random weights: it takes as long as if it were trained" in done.stderr


def test_processor_time_is_counted_on_one_thread_alone_and_said(logs, capsys):
    arguments = ["latency", "logs", "--processor-time", "--frames", "2", "--warm-up", "0", "--out", "profile.json"]
    with pytest.raises(SystemExit):
        main(arguments)
    assert capsys.readouterr().err.startswith("Error: --processor-time: is what a chain takes on one thread of a CPU")
    done = CliRunner().invoke(cli, [*arguments, "--threads", "1"])
    assert done.exit_code == 0, done.output
    assert read_profile(logs / "profile.json").made_by.machine["clock"] == "processor time"
    assert "clock processor time" in done.stdout


def test_a_table_shows_stages_models_and_chains_with_their_shares():
    made_by = {"command": "", "version": "1", "machine": {}}
    stages = {"align": (1.0, 1.0), "decode": (2.0, 4.0)}
    models = {"quick": (2.0, 2.0), "slow": (20.0, 36.0)}
    lines = list(latency.table(LatencyProfile(format=1, made_by=made_by, stages=stages, models=models)))
    assert [line.split() for line in lines] == [
        ["ms", "median", "99", "%", "most", "with", "quick", "with", "slow"],
        ["decode", "3.00", "3.98", "4.00", "50.0%", "9.4%"],
        ["align", "1.00", "1.00", "1.00", "16.7%", "3.1%"],
        ["quick", "2.00", "2.00", "2.00", "33.3%"],
        ["slow", "28.00", "35.84", "36.00", "87.5%"],
        ["whole", "with", "quick", "6.00", "6.98", "7.00"],
        ["whole", "with", "slow", "32.00", "40.82", "41.00"],
    ]
    alone = list(latency.table(LatencyProfile(format=1, made_by=made_by, stages=stages, models={})))
    assert [line.split()[-1] for line in alone] == ["share", "75.0%", "25.0%", "5.00"]


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--model", "fues"], "Error: --model: 'fues' is not one of"),
        (["--warm-up", "99"], "Error: --warm-up: 99 leaves no frame to measure"),
        (["--device", "tpu"], "Error: --device: there is no device 'tpu' on this machine"),
        (["--right", "nothing"], "Error: nothing/toy: is not a folder"),
        (["--camera", "left"], "Error: logs/val/toy.mcap: camera: 'left' is not front, the only choice"),
    ],
)
def test_faults_are_one_line_and_leave_no_profile(logs, capsys, arguments, fault):
    with pytest.raises(SystemExit) as stopped:
        main(["latency", "logs", *arguments, "--out", "profile.json"])
    assert stopped.value.code == 1
    error = capsys.readouterr().err
    assert error.splitlines()[-1].startswith(fault)
    assert not (logs / "profile.json").exists()
