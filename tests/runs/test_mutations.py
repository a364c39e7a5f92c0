"""Nothing that a run keeps is read where its bytes are not those that were written, or are another file's."""

import random

import pytest
from support.mutations import KINDS, make_run, mutate

from semgrid_eval.executors import InProcess
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.runner import RunOptions, run_matrix
from semgrid_eval.scores import results

MADE_AGAIN = ["sums", "expected", "predictions", "history", "windows", "thumbnails", "grids", "truth", "weights"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("mutated"))


@pytest.mark.parametrize("kind", KINDS)
def test_no_changed_file_is_accepted(run, kind):
    found = list(mutate(run, kind, 40, random.Random(kind)))
    assert len(found) > 30
    assert not any(found)


@pytest.mark.parametrize("kind", MADE_AGAIN)
def test_a_changed_file_is_made_again_alike_by_the_same_run(run, kind, caplog):
    """Results go with what is changed, so that weights, grids and the truth are asked for again."""
    pattern, _ = KINDS[kind]
    path = min(run.glob(pattern))
    whole = path.read_bytes()
    content = bytearray(whole)
    content[len(content) // 3] ^= 16
    path.write_bytes(content)
    if kind in ("weights", "truth"):
        for result in run.glob("results/*/sums.npz"):
            result.write_bytes(b"")
    options = RunOptions("cpu", run / "grids", "test", executor=InProcess())
    record = run_matrix(load_matrix(str(run.parent / "m.yaml")), run.parent / "logs", run, options)
    assert [row.failure for row in record.rows] == [None] * 3
    assert all(results.is_done(results.result_folder(run, each)) for row in record.rows for each in row.results)
    assert path.read_bytes() == whole or kind == "history"  # that holds seconds, too
    assert [text for text in caplog.messages if str(path) in text and "again" in text]
