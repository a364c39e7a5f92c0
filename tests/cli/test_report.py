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


@pytest.fixture(scope="module")
def before_and_after(tmp_path_factory):
    """Two runs with the same rows, of which one has got worse."""
    folder = tmp_path_factory.mktemp("gate")
    for name, wrong in (("before", 0.06), ("after", 0.3)):
        rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", wrong, 1))
        make_fake_run(folder / name, rows=rows, recordings=4, windows=1)
    return folder / "before", folder / "after"


@pytest.mark.slow
def test_a_gate_that_fails_is_exit_code_1_with_a_line_for_each_limit_and_the_page(before_and_after, tmp_path, capsys):
    limits = ("--fail-below", "mean_known: -0.01", "--fail-below", "road:-1")
    code, out, err = _run(capsys, "report", *before_and_after, *limits, "--out", tmp_path / "page")
    assert code == 1
    assert Path(out.strip()).is_file()
    lines = [line for line in err.splitlines() if "gate: " in line and "/" not in line]
    assert [line.split("] ")[1] for line in lines] == [
        *("holds -0.0100", "holds -1.0000"),
        *("is clearly below -0.0100", "holds -1.0000"),
    ]
    assert [line.startswith("Error: gate: ED-DC, mean_known: -0.") for line in lines] == [False, False, True, False]


@pytest.mark.slow
def test_a_gate_that_holds_is_exit_code_0(before_and_after, tmp_path, capsys):
    held = ("--fail-below", "mean_known: -0.01", "--out", tmp_path / "page")
    assert _run(capsys, "report", *reversed(before_and_after), *held)[0] == 0
    assert _run(capsys, "report", *before_and_after, *held, "--row", "BL-*", "-q")[::2] == (0, "")


def test_a_gate_that_asks_for_what_is_not_there_is_refused(before_and_after, tmp_path, capsys):
    before, after = before_and_after
    code, out, err = _run(capsys, "report", before, after, "--fail-below", "cars: -0.01", "--out", tmp_path / "page")
    assert (code, out) == (1, "")
    assert err.startswith("Error: --fail-below: 'cars' is not one of unknown, road, ")
    assert err.endswith("did you mean car?\n")
    for arguments in ((before, "--fail-below", "car: 0"), (before, after, "--row", "ED-DC")):
        code, out, err = _run(capsys, "report", *arguments, "--out", tmp_path / "page")
        assert (code, out) == (2, "")
        assert "--fail-below" in err
    assert not (tmp_path / "page").exists()


def test_a_report_of_several_runs_needs_a_folder_of_its_own(before_and_after, capsys):
    code, out, err = _run(capsys, "report", *before_and_after)
    assert (code, out) == (1, "")
    assert err == "Error: --out: the report of several runs belongs to none of them: name a folder\n"
    assert not any((run / "report").exists() for run in before_and_after)


def test_a_run_that_is_given_twice_is_refused(before_and_after, tmp_path, capsys):
    before, _ = before_and_after
    same = before.parent / "other" / ".." / before.name
    code, out, err = _run(capsys, "report", before, same, "--out", tmp_path / "page")
    assert (code, out) == (1, "")
    assert err == f"Error: {same}: run: is given twice\n"
    assert not (tmp_path / "page").exists()
