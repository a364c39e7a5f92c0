import shlex

import pytest
from click.testing import CliRunner

from semgrid_eval.cli.convert_synthetic import synthetic
from semgrid_eval.cli.main import cli, main
from semgrid_eval.log.store import LogReader, find_logs


def test_the_example_writes_logs_and_a_second_run_keeps_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, *arguments = shlex.split(synthetic.epilog.removeprefix("Example: "))
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    assert "2 written, 0 up to date, 0 failed" in done.output
    logs = find_logs(tmp_path / "logs")
    assert [log.parent.name for log in logs] == ["train", "val"]
    with LogReader(logs[0]) as log:
        assert sum(1 for _ in log.frames("front")) == 30
        assert len(list(log.poses())) == 30
    before = [log.stat().st_mtime_ns for log in logs]
    again = CliRunner().invoke(cli, arguments)
    assert "0 written, 2 up to date, 0 failed" in again.output
    assert [log.stat().st_mtime_ns for log in logs] == before


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--width", "1000000"], "Error: width: "),
        (["--towns", "1"], "Error: (top level): training and validation need different towns"),
        (["--duration-s", "0"], "Error: duration_s: "),
    ],
)
def test_an_impossible_wish_is_one_line(option, message, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["convert", "synthetic", str(tmp_path), "--recordings", "2", *option])
    error = capsys.readouterr().err
    assert stopped.value.code == 1
    assert error.startswith(message)
    assert error.count("\n") == 1
