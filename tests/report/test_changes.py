from dataclasses import replace

import numpy as np
import pytest

from semgrid_eval.report.changes import changed_settings, changes_table, flat
from semgrid_eval.report.estimates import score_rows
from semgrid_eval.report.reading import load_runs


def test_settings_are_compared_key_by_key():
    before = {"network": {"depth": 3, "features": 64}, "translate": True, "sensors": ["front"]}
    after = {"network": {"depth": 4, "features": 64}, "translate": False, "sensors": ["a", "b"], "clip": None}
    assert changed_settings(before, after) == [
        "network.depth 3 to 4",
        "translate true to false",
        "sensors front to a, b",
        "clip not set to none",
    ]
    assert changed_settings(before, before) == []


def test_nested_settings_get_dotted_names():
    assert flat({"a": {"b": {"c": 1}}, "d": 2}) == {"a.b.c": 1, "d": 2}


def test_each_row_is_set_against_the_dc_row_of_its_model(run):
    scores = score_rows(load_runs([run])[0].rows, np.random.default_rng(0), draws=20)
    table = changes_table(scores)
    assert [body[0].header for body in table.bodies] == [
        f"{name} \N{MINUS SIGN} {name[:2]}-DC" for name in ("BL-NT", "BL-Fuse", "BL-Sp2", "ED-Sp2")
    ]
    settings, score = table.bodies[-1][0].cells
    assert settings.text == "experiment DC to Sp2"
    assert score.sort == pytest.approx(scores["ED-Sp2"].mean["mean_known"] - scores["ED-DC"].mean["mean_known"])


def test_rows_that_change_nothing_give_no_table(run):
    row = load_runs([run])[0].rows[0]
    twins = [row, replace(row, name="twin")]
    assert changes_table(score_rows(twins, np.random.default_rng(0), draws=2)) is None
