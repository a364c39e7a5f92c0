"""A report in the place of an earlier one: nothing foreign is lost, and no moment is without a report."""

import json
import os
from threading import Thread

import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.errors import InputError
from semgrid_eval.files import read_json
from semgrid_eval.report.page.replace import _TOP
from semgrid_eval.report.page.write import write_report

SMALL = {"rows": (FakeRow("DC", "BL"),), "recordings": 2, "windows": 1}


@pytest.fixture
def reported(tmp_path):
    """A run with its report, written without exchange where the parameter says so."""
    run = make_fake_run(tmp_path / "run", **SMALL)
    write_report(run)
    return run


def own_files(report):
    return {str(path.relative_to(report)) for path in report.rglob("*") if path.is_file()}


def test_a_report_lists_all_its_files(reported):
    assert set(read_json(reported / "report" / "report.json")["files"]) == own_files(reported / "report")


@pytest.mark.parametrize("exchanges", [True, False])
def test_what_is_not_the_reports_stays_and_what_it_no_longer_writes_goes(reported, monkeypatch, exchanges):
    if not exchanges:
        monkeypatch.setattr("semgrid_eval.places.exchange", lambda *_: False)
    report, before = reported / "report", own_files(reported / "report")
    (report / "figures" / "mine").mkdir()
    (report / "figures" / "mine" / "a.png").write_bytes(b"a")
    (report / "link").symlink_to(reported)
    record = read_json(report / "report.json")
    (report / "old.csv").touch()
    (report / "report.json").write_text(json.dumps({**record, "files": [*record["files"], "old.csv"]}))
    write_report(reported)
    assert own_files(report) == before | {"figures/mine/a.png"}
    assert (report / "figures" / "mine" / "a.png").read_bytes() == b"a"
    assert (report / "link").readlink() == reported
    assert {path.name for path in reported.iterdir()} == {"run.json", "results", "windows", "report"}


EARLIER = ("classes.csv", "regions.csv", "paces.csv", "where.csv", "categories.csv", "figures/category_static.svg")


def test_a_report_that_does_not_list_its_files_is_replaced_but_for_what_no_report_writes(reported):
    report, before = reported / "report", own_files(reported / "report")
    record = read_json(report / "report.json")
    (report / "report.json").write_text(json.dumps({key: record[key] for key in record if key != "files"}))
    for name in (*EARLIER, "README.md", "mine.csv", "figures/mine/a.png"):
        (report / name).parent.mkdir(exist_ok=True)
        (report / name).write_text("old")
    write_report(reported)
    assert own_files(report) == before | {"README.md", "mine.csv", "figures/mine/a.png"}
    assert (report / "README.md").read_text() == "old"
    assert set(read_json(report / "report.json")["files"]) == before


@pytest.mark.parametrize("record", [{}, {"files": []}, {"semgrid_eval": "0.1.0", "files": []}])
def test_a_foreign_file_in_the_way_is_told_before_anything_is_worked_out(reported, monkeypatch, record):
    monkeypatch.setattr("semgrid_eval.report.page.write.gather", lambda *_: pytest.fail("worked out in vain"))
    (reported / "report" / "report.json").write_text(json.dumps(record))
    with pytest.raises(InputError, match="is not the earlier report's, and the new one has a file of this name"):
        write_report(reported)


def test_every_name_beside_the_page_is_known_beforehand(reported):
    names = [name for name in own_files(reported / "report") if "/" not in name]
    assert [name for name in names if not _TOP.fullmatch(name)] == []
    assert _TOP.fullmatch("matrix-2.yaml")


def test_a_foreign_file_under_the_name_of_one_of_the_reports_is_told(reported):
    report = reported / "report"
    record = read_json(report / "report.json")
    (report / "report.json").write_text(json.dumps({**record, "files": []}))
    with pytest.raises(InputError, match="is not the earlier report's, and the new one has a file of this name"):
        write_report(reported)
    assert (report / "index.html").is_file()


@pytest.mark.slow
def test_two_reports_at_once_both_succeed(reported):
    failed = []

    def report():
        try:
            write_report(reported)
        except Exception as error:
            failed.append(error)

    threads = [Thread(target=report) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert set(read_json(reported / "report" / "report.json")["files"]) == own_files(reported / "report")


def test_a_report_has_the_rights_that_the_umask_leaves(tmp_path):
    run = make_fake_run(tmp_path / "run", **SMALL)
    before = os.umask(0o077)
    try:
        page = write_report(run)
    finally:
        os.umask(before)
    assert page.parent.stat().st_mode & 0o777 == 0o700
    assert page.stat().st_mode & 0o777 == 0o600
