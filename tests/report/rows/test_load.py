from dataclasses import replace

import pytest
from support.fake_run import FakeRow, make_fake_run

from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.rows.load import key_of, load_runs
from semgrid_eval.scores.results import read_run, write_run


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


def test_a_row_that_is_skipped_has_neither_failed_nor_is_its_turn_to_come(tmp_path):
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "BL"),), recordings=1, windows=1)
    record = read_run(run)
    skipped = record.rows[0].model_copy(update={"name": "ceiling", "results": (), "skipped": "no truth"})
    write_run(run, record.model_copy(update={"rows": (*record.rows, skipped)}))
    row = load_runs([run])[0].rows[1]
    assert (row.is_skipped, row.is_left, row.failures) == (True, False, ())
