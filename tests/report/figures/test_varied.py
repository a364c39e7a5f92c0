from dataclasses import replace

import numpy as np
import pytest
from support.scoring import score_rows

from semgrid_eval.report.figures.settings import settings_frame, settings_plots, varied_settings
from semgrid_eval.report.rows.load import load_runs


@pytest.fixture(scope="module")
def row(run):
    return load_runs([run])[0].rows[3]


def scored(row, *settings, **shared):
    """Scores of copies of a row with other settings, named by these."""
    rows = []
    for each in settings:
        record = row.results[0].record.model_copy(update={"config": {"settings": each} | shared})
        rows.append(replace(row, name=str(each), results=(replace(row.results[0], record=record),)))
    return score_rows(rows, np.random.default_rng(0), draws=20)


def found(scores):
    return [(varied.keys, [entry.row.name for entry in varied.rows]) for varied in varied_settings(scores)]


def test_rows_that_differ_in_two_settings_are_lines_over_the_one_with_more_values(row):
    settings = [{"width": f, "steps": d, "exact": False} for d in (2, 3, 4) for f in (16, 32)]
    (varied,) = varied_settings(scored(row, *settings))
    assert varied.keys == ("settings.steps", "settings.width")
    lines = [[(varied.value(e), varied.value(e, 1)) for e in line] for line in varied.lines()]
    assert lines == [[(2, 16), (3, 16), (4, 16)], [(2, 32), (3, 32), (4, 32)]]


def test_rows_that_differ_in_more_are_not_in_the_set(row):
    scores = scored(row, {"a": 1, "kind": "x"}, {"a": 2, "kind": "x"}, {"a": 3, "kind": "y"}, {"a": 2, "kind": "x"})
    assert found(scores) == [(("settings.a",), ["{'a': 1, 'kind': 'x'}", "{'a': 2, 'kind': 'x'}"])]


def test_every_set_has_a_figure_of_its_own(row):
    scores = scored(row, *({"a": a, "kind": kind} for kind in ("x", "y") for a in (1, 2)))
    assert [len(names) for _, names in found(scores)] == [2, 2]
    assert [plot.name for plot in settings_plots(scores)] == ["settings", "settings-2"]


@pytest.mark.parametrize(
    "settings",
    [
        [{"a": 1}],
        [{"a": 1}, {"a": 1}],
        [{"a": True}, {"a": False}],
        [{"a": "x"}, {"a": "y"}],
        [{"a": None}, {"a": 1}],
        [{"a": 1, "b": 1}, {"a": 2, "b": 2}],
        [{"horizon_steps": 1}, {"horizon_steps": 2}],
    ],
)
def test_nothing_is_drawn_where_no_number_varies_alone(row, settings):
    assert found(scored(row, *settings)) == []


def test_rows_of_other_targets_are_not_in_one_set(row):
    scores = scored(row, {"a": 1}, {"a": 2})
    last = scores["{'a': 2}"]
    result = last.row.results[0]
    moved = replace(result, record=result.record.model_copy(update={"targets": "others"}))
    assert found(scores | {"{'a': 2}": replace(last, row=replace(last.row, results=(moved,)))}) == []


def test_the_table_holds_what_the_figure_shows(row):
    scores = scored(row, *({"depth": depth, "features": features} for depth, features in ((2, 16), (3, 16), (3, 32))))
    (plot,) = settings_plots(scores)
    assert "features 16" in plot.svg
    assert "Rows that differ in settings.depth and settings.features alone" in plot.caption
    table = settings_frame(scores)
    assert table.value.tolist() == [2, 3, 3]
    assert table.by_value.tolist() == [16, 16, 32]
    assert (table.low <= table.iou).all()
    assert table.iou[0] == scores[table.row[0]].mean["mean_known"]
    assert not [name for name in table.columns if "ms" in name or "seconds" in name]
