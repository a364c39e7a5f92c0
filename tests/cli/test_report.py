from pathlib import Path

import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.cli.main import main
from semgrid_eval.scores.results import read_run, result_folder


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


@pytest.mark.parametrize(
    ("pattern", "kind"),
    [
        ("results/*/sums.npz", "row BL-DC"),
        ("results/*/result.json", "row BL-DC"),
        ("results/*/predictions.npz", "predictions"),
        ("windows/*.npz", "windows"),
    ],
)
def test_a_damaged_file_is_named_and_the_page_still_written(tmp_path, capsys, pattern, kind):
    rows = (FakeRow("DC", "BL"), FakeRow("Fuse", "BL"))
    run = make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1)
    record = read_run(run)
    paths = {path for path in run.glob(pattern) if path.parent.name in (record.rows[0].results[0], "windows")}
    path = min(paths)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)
    code, out, err = _run(capsys, "report", run)
    assert code == 1
    (line,) = [line for line in err.splitlines() if line.startswith("Error: ")]
    assert line.startswith(f"Error: {kind}")
    assert "is damaged: its content does not match its seal" in line
    page = Path(out.strip()).read_text()
    assert f'<strong class="name">{kind}' in page
    assert "BL-Fuse" in page


@pytest.mark.parametrize("name", ["sums.npz", "predictions.npz", "result.json"])
def test_a_file_of_another_result_is_not_taken_for_ones_own(tmp_path, capsys, name):
    rows = (FakeRow("DC", "BL"), FakeRow("Fuse", "BL"))
    run = make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1)
    one, other = (result_folder(run, row.results[0]) for row in read_run(run).rows)
    (one / name).write_bytes((other / name).read_bytes())
    code, _, err = _run(capsys, "report", run)
    assert code == 1
    assert f"{name}: belongs to another id ({other.name}, not {one.name})" in err
