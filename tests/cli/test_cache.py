import shlex

import pytest
from click.testing import CliRunner
from support.small_runs import run, write_logs

from semgrid_eval.cli.cache import command
from semgrid_eval.cli.main import cli


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A run with its grids, grids that nobody uses, and a town beside the logs."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    run([{"name": "BL-DC", "model": "newest"}], write_logs(tmp_path / "logs"), tmp_path / "runs" / "first")
    (tmp_path / "runs" / "grids").rename(tmp_path / "runs" / "first" / "grids")
    (tmp_path / "runs" / "first" / "grids" / "lost-0123456789abcdef.npz").write_bytes(b"0" * 100_000)
    town = tmp_path / "logs" / ".towns" / "town-0123456789abcdef"
    town.mkdir(parents=True)
    (town / "town.json").write_text("{}")
    return tmp_path


def call(*arguments):
    done = CliRunner().invoke(cli, ["cache", *arguments])
    return done.exit_code, done.stdout.splitlines(), done.stderr.splitlines()


def test_the_example_lists_grids_and_towns_with_sizes_and_ages(place):
    program, name, *arguments = shlex.split(command.epilog.removeprefix("Example: "))
    code, (heads, *lines), _ = call(*arguments)
    assert (program, name, code) == ("semgrid-eval", "cache", 0)
    rows = [dict(zip(heads.split("\t"), line.split("\t"), strict=True)) for line in lines]
    assert [(row["folder"], row["kind"], row["number"]) for row in rows] == [
        ("runs/first/grids", "grids", "3"),
        ("logs/.towns", "town", "1"),
    ]
    assert rows[1]["days since use"] == "0.0 to 0.0"
    _, (heads, *lines), _ = call(*arguments, "--run", "runs/first")
    assert [line.split("\t")[-2:] for line in lines] == [["1", "0.1 MB"], ["0", "0.0 MB"]]


def test_cleaning_says_what_would_go_and_removes_it_only_with_yes(place):
    lost = place / "runs" / "first" / "grids" / "lost-0123456789abcdef.npz"
    said = call("runs/first", "logs", "--clean", "--run", "runs/first")
    assert said == (0, [str(lost.relative_to(place))], ["would be removed: 1 of 4, 0.1 MB; --yes removes it"])
    assert lost.exists()
    said = call("runs/first", "logs", "--clean", "--run", "runs/first", "--yes")
    assert said == (0, [str(lost.relative_to(place))], ["removed: 1 of 4, 0.1 MB"])
    assert not lost.exists()
    assert call("runs/first", "--clean", "--run", "runs/first", "--yes")[1] == []
    assert len(list((place / "runs" / "first" / "grids").glob("*.npz"))) == 2


def test_age_alone_takes_everything_that_is_older(place):
    assert len(call("runs/first", "logs", "--clean", "--older-than", "0", "--yes")[1]) == 4
    assert call("runs/first")[0] == 1
    assert (place / "logs" / ".towns").is_dir()
    assert (place / "runs" / "first" / "run.json").is_file()


def test_cleaning_without_saying_what_stays_is_refused(place):
    code, out, err = call("runs/first", "--clean", "--yes")
    assert (code, out) == (2, [])
    assert err[-1] == "Error: --clean needs to know what stays: --run RUN or --older-than DAYS, or both"
