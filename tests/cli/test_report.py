from pathlib import Path

import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.cli.main import main


def _run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    return stop.value.code, printed.out, printed.err


def test_report_prints_the_page_alone_on_stdout(tmp_path, capsys):
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "BL"),), recordings=2, windows=1)
    code, out, err = _run(capsys, "report", run, "--out", tmp_path / "page")
    assert code == 0
    assert Path(out.strip()) == tmp_path / "page" / "index.html"
    assert Path(out.strip()).is_file()
    assert "reading results: 1/1" in err


def test_report_of_no_run_is_one_line(tmp_path, capsys):
    code, out, err = _run(capsys, "report", tmp_path)
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert str(tmp_path) in err


def test_report_resamples_groups_where_it_is_asked_to(tmp_path, capsys):
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "BL"),), recordings=2, windows=1)
    code, out, _ = _run(capsys, "report", run, "--resample", "groups")
    assert code == 0
    assert "resampling groups of recordings" in Path(out.strip()).with_name("report.json").read_text()
    code, _, err = _run(capsys, "report", run, "--resample", "cells")
    assert code == 2
    assert "'recordings', 'groups'" in err
