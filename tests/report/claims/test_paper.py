from dataclasses import replace
from functools import reduce
from operator import getitem

import pytest

from semgrid_eval.report.claims.claims import PAPER_REPEATS, PAPER_SETTINGS, PAPER_WINDOWS, scaling
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.runs.matrix import load_matrix

PAPER = {"depth": 3, "features": 64, "training": {"batch": 32, "epochs": 40, "updates_per_epoch": 185}}


@pytest.fixture(scope="module")
def trained(run):
    """The run with its trained rows that the paper has, too."""
    (found,) = load_runs([run])
    return replace(found, rows=tuple(row for row in found.rows if row.name in ("ED-DC", "ED-Sp2")))


def _configured(run, repeats, windows, **settings):
    """The run with results of that configuration, as many of each row, on as many windows."""
    rows = []
    for row in run.rows:
        first = row.results[0]
        record = first.record.model_copy(
            update={"config": {"settings": settings}, "windows": first.record.windows[:1] * windows}
        )
        results = (replace(first, record=record),) * repeats
        rows.append(replace(row, results=results))
    return replace(run, rows=tuple(rows))


def _on(run, dataset):
    logs = tuple(log.model_copy(update={"dataset": dataset}) for log in run.record.logs)
    return replace(run, record=run.record.model_copy(update={"logs": logs}))


def test_a_run_as_large_as_the_papers_says_so(trained):
    whole = _on(_configured(trained, PAPER_REPEATS, PAPER_WINDOWS, **PAPER), "cityscapes")
    assert scaling(whole) == "Trained as the paper's supplement says."


def test_what_is_smaller_is_named_beside_the_papers_value(trained):
    text = scaling(_configured(trained, 1, 120, depth=3, features=32, training={"epochs": 20}))
    assert text == (
        "Scaled from the paper's supplement: features 32 instead of 64, epochs 20 instead of 40, "
        "repeats 1 instead of 20, scored windows 120 instead of 500, data synthetic instead of Cityscapes."
    )


def test_other_data_beside_the_papers_is_named(trained):
    logs = [log.model_copy(update={"dataset": name}) for log in trained.record.logs for name in ("town", "cityscapes")]
    both = replace(trained, record=trained.record.model_copy(update={"logs": tuple(logs)}))
    assert "data town besides Cityscapes" in scaling(both)


def test_rows_that_differ_are_told_apart(trained):
    small = _configured(trained, 1, 500, features=16).rows[0]
    large = _configured(trained, 1, 500, features=32).rows[1]
    assert "features 16 or 32 instead of 64" in scaling(replace(trained, rows=(small, large)))


def test_a_run_without_a_trained_row_of_the_paper_says_nothing(run):
    (found,) = load_runs([run])
    assert scaling(replace(found, rows=tuple(row for row in found.rows if row.is_baseline))) == ""


def test_the_papers_settings_are_those_of_its_preset():
    row = next(row for row in load_matrix("paper").rows if row.name == "ED-DC")
    for key, (_, value) in PAPER_SETTINGS.items():
        assert reduce(getitem, key.split("."), row.model_dump()) == value
    assert row.repeats == PAPER_REPEATS
