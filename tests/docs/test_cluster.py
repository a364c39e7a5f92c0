"""What the page on clusters says of machines that share nothing: parts of a run that were made apart become one."""

import shutil

import pytest
from support.small_runs import run, write_logs
from support.spread import contents

from semgrid_eval.scores.results import RUN_FILE

ROWS = [{"name": "BL-DC", "model": "newest"}, {"name": "ED", "model": "ed", "repeats": 2}]


def times(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*.npz")}


@pytest.mark.slow
def test_rows_that_were_run_apart_are_found_in_one_folder(tmp_path):
    whole = tmp_path / "whole" / "run"
    for name, only in (("first", ("BL-*",)), ("second", ("ED",))):
        part = tmp_path / name
        write_logs(part / "logs")
        run(ROWS, part / "logs", part / "run", only=only)
        shutil.copytree(part / "run", whole, dirs_exist_ok=True, ignore=shutil.ignore_patterns(RUN_FILE))
    write_logs(tmp_path / "whole" / "logs")
    kept, made = contents(whole), times(whole)
    record = run(ROWS, tmp_path / "whole" / "logs", whole)
    assert [(row.failure, len(row.results)) for row in record.rows] == [(None, 1), (None, 2)]
    after = contents(whole)
    assert {path: after[path] for path in kept} == kept
    assert set(after) - set(kept) <= {RUN_FILE}
    assert times(whole) == made  # nothing was made again
