"""Counts on disk: regions where there is truth, and faults by name."""

import numpy as np
import pytest

from semgrid_eval.arrays import write_arrays
from semgrid_eval.classes import CLASS_COUNT
from semgrid_eval.errors import ResultError
from semgrid_eval.scores.results import LogRecord, ResultRecord, RunRecord, read_counts, scored_digest, write_counts


def counts_of(windows, seed=0):
    return np.random.default_rng(seed).integers(0, 99, (windows, CLASS_COUNT, CLASS_COUNT))


def test_regions_come_back_as_they_were_written(tmp_path):
    regions = {"moving": counts_of(3, 1), "standing": counts_of(3, 2)}
    write_counts(tmp_path, counts_of(3), regions)
    everywhere, found = read_counts(tmp_path)
    np.testing.assert_array_equal(everywhere, counts_of(3))
    assert list(found) == ["moving", "standing"]
    for name, counts in regions.items():
        np.testing.assert_array_equal(found[name], counts)


def test_counts_without_the_truth_have_no_regions(tmp_path):
    write_counts(tmp_path, counts_of(2), {})
    assert read_counts(tmp_path)[1] == {}


@pytest.mark.parametrize(
    ("moving", "message"),
    [
        (counts_of(3)[:, :4], r"counts\.npz: counts_moving: has shape \(3, 4, 10\), type int64"),
        (counts_of(3).astype(np.int32), "counts_moving: has shape .* type int32"),
        (counts_of(2), "counts_moving: has 2 windows, not 3"),
    ],
)
def test_malformed_regions_are_named(tmp_path, moving, message):
    write_arrays(tmp_path / "counts.npz", {"counts": counts_of(3), "counts_moving": moving})
    with pytest.raises(ResultError, match=message):
        read_counts(tmp_path)


def test_missing_counts_are_named(tmp_path):
    with pytest.raises(ResultError, match=r"counts\.npz: cannot be read"):
        read_counts(tmp_path)


@pytest.mark.parametrize(("path", "expected"), [("a.mcap", "scored"), ("b.mcap", "other"), ("c.mcap", None)])
def test_the_digest_of_a_log_is_that_which_was_scored(path, expected):
    logs = [("a.mcap", "other"), ("a.mcap", "scored"), ("a.mcap", "trained"), ("b.mcap", "other"), ("c.mcap", "none")]
    records = tuple(LogRecord(name="", path=p, digest=digest, split="", dataset="") for p, digest in logs)
    run = RunRecord.model_construct(logs=records)
    result = ResultRecord.model_construct(log_digests=("other", "scored"))
    assert scored_digest(run, result, path) == expected
