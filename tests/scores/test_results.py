"""Sums on disk: of every metric by every partition that is known, and faults by name."""

import os

import numpy as np
import pytest
from support.windows import random_windows

from semgrid_eval.errors import ResultError
from semgrid_eval.scores.metrics.table import count_windows
from semgrid_eval.scores.results import LogRecord, ResultRecord, RunRecord, is_done, scored_digest
from semgrid_eval.scores.sums import EXPECTED_FILE, SUMS_FILE, check_sums, read_sums, write_sums


def counted(**kwargs):
    return dict(count_windows(random_windows(1, **kwargs)))


def test_sums_come_back_as_they_were_written(tmp_path):
    write_sums(tmp_path, counted())
    for (metric, partition), sums in counted().items():
        np.testing.assert_array_equal(read_sums(tmp_path, metric, partition), sums)
    np.testing.assert_array_equal(read_sums(tmp_path, "iou", "all")[:, 0], counted()["iou", "all"][:, 0])
    check_sums(tmp_path, 3)


def test_sums_without_the_truth_have_no_actors(tmp_path):
    write_sums(tmp_path, counted(actors=False))
    assert read_sums(tmp_path, "iou", "actors") is None
    check_sums(tmp_path, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda sums: sums[:, :, :4], r"sums\.npz: iou\.actors: has shape \(3, 2, 4, 10\), type int32"),
        (lambda sums: sums[:, :1], r"iou\.actors: has shape \(3, 1, 10, 10\)"),
        (lambda sums: sums.astype(np.int64), r"iou\.actors: has shape .* type int64"),
        (lambda sums: sums[:2], r"iou\.actors: has 2 windows, and result\.json 3"),
        (lambda sums: sums - 1, r"iou\.actors: has shape .*, or is negative"),
    ],
)
def test_malformed_sums_are_named(tmp_path, change, message):
    sums = counted()
    sums["iou", "actors"] = change(sums["iou", "actors"])
    write_sums(tmp_path, sums)
    with pytest.raises(ResultError, match=message):
        check_sums(tmp_path, 3)


def test_sums_of_a_metric_that_is_not_there_are_named(tmp_path):
    write_sums(tmp_path, {key: sums for key, sums in counted().items() if key[0] != "accuracy"})
    with pytest.raises(ResultError, match=r"has no array accuracy\.all"):
        check_sums(tmp_path, 3)
    assert not is_done(tmp_path)


@pytest.mark.parametrize(("taken", "place"), [(EXPECTED_FILE, SUMS_FILE), (SUMS_FILE, EXPECTED_FILE)])
def test_sums_against_one_target_cannot_stand_in_for_those_against_the_other(tmp_path, taken, place):
    for file in (SUMS_FILE, EXPECTED_FILE):
        write_sums(tmp_path, counted(), file=file)
    check_sums(tmp_path, 3, has_expected=True)
    (tmp_path / place).write_bytes((tmp_path / taken).read_bytes())
    with pytest.raises(ResultError, match=f"{place}: belongs to another id"):
        check_sums(tmp_path, 3, has_expected=True)


def test_missing_sums_are_named(tmp_path):
    with pytest.raises(ResultError, match=r"sums\.npz: cannot be read"):
        read_sums(tmp_path, "iou", "all")


@pytest.mark.parametrize(("path", "expected"), [("a.mcap", "scored"), ("b.mcap", "other"), ("c.mcap", None)])
def test_the_digest_of_a_log_is_that_which_was_scored(path, expected):
    logs = [("a.mcap", "other"), ("a.mcap", "scored"), ("a.mcap", "trained"), ("b.mcap", "other"), ("c.mcap", "none")]
    records = tuple(LogRecord(name="", path=p, digest=digest, split="", dataset="") for p, digest in logs)
    run = RunRecord.model_construct(logs=records)
    result = ResultRecord.model_construct(log_digests=("other", "scored"))
    assert scored_digest(run, result, path) == expected


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_sums_that_are_no_file_are_not_waited_for(tmp_path, make):
    make(tmp_path / "sums.npz")
    with pytest.raises(ResultError, match=r"sums\.npz: is not a regular file"):
        read_sums(tmp_path, "iou", "all")


def test_sums_of_another_result_are_refused(tmp_path):
    for name in ("one", "other"):
        write_sums(tmp_path / name, counted())
    (tmp_path / "one" / "sums.npz").replace(tmp_path / "other" / "sums.npz")
    with pytest.raises(ResultError, match=r"sums\.npz: belongs to another id \(one, not other\)"):
        read_sums(tmp_path / "other", "iou", "all")
