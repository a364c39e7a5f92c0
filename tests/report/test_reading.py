from dataclasses import replace

import pytest

from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.reading import load_runs


@pytest.fixture(scope="module")
def result(run):
    return load_runs([run])[0].rows[0].shown


def with_config(result, **config):
    return replace(result, record=result.record.model_copy(update={"config": config}))


def test_the_grids_of_a_result_are_known_where_it_tells(result):
    grid = GridConfig(camera="rear")
    assert with_config(result, grid=grid.model_dump(mode="json")).grid == grid
    assert with_config(result, grid={"cells": 3}).grid is None
    assert result.grid is None
