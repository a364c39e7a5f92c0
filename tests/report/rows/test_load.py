from dataclasses import replace

import pytest

from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.rows.load import key_of, load_runs


@pytest.fixture(scope="module")
def result(run):
    return load_runs([run])[0].rows[0].shown


def with_config(result, **config):
    return replace(result, record=result.record.model_copy(update={"config": config}))


def test_the_grids_of_a_result_are_known_where_it_tells(result):
    grid = GridConfig(target=("split1_upper",))
    assert with_config(result, grid=grid.model_dump(mode="json")).grid == grid
    assert with_config(result, grid={"cells": 3}).grid is None
    assert result.grid is None


def test_nested_settings_get_dotted_names(result):
    assert with_config(result, a={"b": {"c": 1}}, d=2).settings == {"a.b.c": 1, "d": 2}


def test_windows_are_found_by_their_target_frames(result):
    assert [result.places[key_of(window)] for window in result.record.windows] == list(range(16))
