from dataclasses import replace

import numpy as np
import pytest

from semgrid_eval.report.estimates.bootstrap import score_rows
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.changes import changed_settings, changes_table


def test_settings_are_compared_key_by_key():
    before = {"network.depth": 3, "network.features": 64, "translate": True, "sensors": ["front"]}
    after = {"network.depth": 4, "network.features": 64, "translate": False, "sensors": ["a", "b"], "clip": None}
    assert changed_settings(before, after) == [
        "network.depth 3 to 4",
        "translate true to false",
        "sensors front to a, b",
        "clip not set to none",
    ]
    assert changed_settings(before, before) == []


def _with_config(row, name, **config):
    results = tuple(replace(r, record=r.record.model_copy(update={"config": config})) for r in row.results)
    record = row.record.model_copy(update={"name": name, "experiment": name})
    return replace(row, name=name, record=record, results=results)


def test_each_row_is_set_against_the_dc_row_of_its_model(run):
    scores = score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=20)
    table = changes_table(scores)
    assert [body[0].header for body in table.bodies] == [
        f"{name} \N{MINUS SIGN} {name[:2]}-DC" for name in ("BL-NT", "BL-Fuse", "BL-Sp2", "ED-Sp2")
    ]
    settings, *_, mean = table.bodies[-1][0].cells
    assert settings.text == "experiment DC to Sp2"
    assert mean.sort == pytest.approx(scores["ED-Sp2"].mean["mean_known"] - scores["ED-DC"].mean["mean_known"])
    for words in ("16 windows", "2 results", "95% interval"):
        assert words in mean.title


def test_a_row_is_set_against_the_one_with_the_fewest_other_settings(run):
    row = load_runs([run])[0].rows[0]
    settings = {
        "default": {"y": "down", "overlay": "upper", "sensors": 1},
        "two": {"y": "down", "overlay": "upper", "sensors": 2},
        "lower": {"y": "down", "overlay": "lower", "sensors": 2},
        "again": {"y": "down", "overlay": "upper", "sensors": 1},  # the same as the first: nothing to show
    }
    rows = [_with_config(row, name, **config) for name, config in settings.items()]
    table = changes_table(score_rows(rows, np.random.default_rng(0), draws=2))
    assert [body[0].header for body in table.bodies] == ["two \N{MINUS SIGN} default", "lower \N{MINUS SIGN} two"]
    assert [body[0].cells[0].text for body in table.bodies] == ["sensors 1 to 2", "overlay upper to lower"]


def test_rows_that_change_nothing_give_no_table(run):
    row = load_runs([run])[0].rows[0]
    twins = [row, replace(row, name="twin")]
    assert changes_table(score_rows(twins, np.random.default_rng(0), draws=2)) is None
