import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from semgrid_eval.report.tables.where import (
    BANDS,
    ORIGINS,
    Where,
    bands_of,
    count_cells,
    locate_row,
    locate_rows,
)
from semgrid_eval.scores.iou import confusion
from support.fake_run import make_fake_run

from semgrid_eval.classes import CLASS_COUNT, UNKNOWN
from semgrid_eval.errors import ResultError
from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables import where
from semgrid_eval.scores.results import read_windows

SHAPE = (2, 8, 8)
SPEC = GridSpec(rows=8, columns=8, cell_m=10.0, agent_row=6, agent_column=3)
CLASSES = st.integers(0, CLASS_COUNT - 1)
GRIDS = arrays(np.uint8, SHAPE, elements=CLASSES)
INPUTS = arrays(np.uint8, (2, 2, 3, 8, 8), elements=CLASSES)
MASKS = arrays(np.bool_, SHAPE)


def _slow_band(row, column):
    return sum(math.hypot((6 - row - 0.5) * 10, (3 - column - 0.5) * 10) >= edge for edge in (20, 40, 60))


def _slow_origin(past):
    if any(past[s][-1] != UNKNOWN for s in range(len(past))):
        return 0
    return 1 if any(cell != UNKNOWN for sensor in past for cell in sensor) else 2


@settings(max_examples=30)
@given(INPUTS, GRIDS, GRIDS, MASKS)
def test_cells_are_counted_like_by_hand(inputs, target, prediction, mask):
    expected = np.zeros((len(BANDS), len(ORIGINS), CLASS_COUNT, CLASS_COUNT), int)
    for n, row, column in np.ndindex(SHAPE):
        if not mask[n, row, column]:
            place = _slow_band(row, column), _slow_origin(inputs[n, :, :, row, column].tolist())
            expected[(*place, target[n, row, column], prediction[n, row, column])] += 1
    got = count_cells(inputs, target, prediction, mask, bands_of(SPEC))
    np.testing.assert_array_equal(got, expected)
    np.testing.assert_array_equal(got.sum(axis=(0, 1)), confusion(target, prediction, mask).sum(axis=0))


def test_bands_grow_with_the_distance_from_the_bottom_middle():
    bands = bands_of(GridSpec())
    assert bands[127, 63] == bands[127, 64] == bands[104, 64] == 0
    assert bands[0, 64] == len(BANDS) - 1
    np.testing.assert_array_equal(bands, bands[:, ::-1])
    assert bands[101, 64] == 1  # 20.7 m ahead
    assert bands[127, 0] == 2  # 49.6 m to the left


@pytest.fixture(scope="module")
def rows(run):
    return {row.name: row for row in load_runs([run])[0].rows}


def test_a_row_in_chunks_counts_all_its_cells(rows):
    found = locate_row(rows["ED-DC"])
    np.testing.assert_array_equal(found.cells.sum(axis=(0, 1)), rows["ED-DC"].shown.counts.sum(axis=0))


def _of_grid(row, **spec):
    """Let a row tell that its grids have another extent."""
    grid = GridConfig(spec=GridSpec(**spec)).model_dump(mode="json")
    record = row.results[0].record.model_copy(update={"config": {"grid": grid}})
    return replace(row, results=(replace(row.results[0], record=record),))


@pytest.mark.parametrize(("cell_m", "band"), [(0.1, 0), (0.25, 1)])
def test_distances_are_in_the_metres_of_the_rows_own_grid(rows, cell_m, band):
    found = locate_row(_of_grid(rows["BL-DC"], cell_m=cell_m))
    assert found.cells[band].any()
    assert not found.cells[band + 1 :].any()


def test_a_row_whose_grids_have_another_shape_than_it_tells_is_named(rows):
    found, (problem,) = locate_rows([_of_grid(rows["BL-DC"], rows=256, agent_row=256)])
    assert found == []
    assert problem.startswith("BL-DC: shapes of windows (16, 128, 128)")


def test_windows_that_rows_share_are_read_once(rows, monkeypatch):
    read = []
    monkeypatch.setattr(where, "read_windows", lambda *args: read.append(args) or read_windows(*args))
    mixed = [rows[name] for name in ("ED-Sp2", "BL-DC", "BL-Sp2", "ED-DC")]
    found, problems = locate_rows(mixed)
    assert [each.row.name for each in found] == ["ED-Sp2", "BL-DC", "BL-Sp2", "ED-DC"]
    assert problems == []
    assert len(read) == len({row.window_set for row in mixed}) == 2


def test_a_baseline_of_the_newest_input_knows_nothing_else(rows):
    seen, older, never = locate_row(rows["BL-DC"]).origin_shares()
    assert seen > 0.9
    assert (older, never) == (0, 0)


def test_calibration_joins_levels_into_bins(rows):
    levels = np.zeros((256, 2), int)
    levels[255] = [1, 3]
    levels[51] = [4, 1]  # certainty 0.2
    levels[0] = [1, 0]
    entry = Where(rows["ED-DC"], np.zeros((4, 3, 10, 10), int), levels)
    table = entry.calibration()
    assert table.certainty.tolist() == pytest.approx([0, 0.2, 1])
    assert table.right.tolist() == pytest.approx([0, 0.2, 0.75])
    assert table.cells.tolist() == [1, 5, 4]
    assert entry.calibration_error() == pytest.approx(0.25 * 4 / 10)


def test_a_row_without_predictions_is_named_and_the_rest_goes_on(tmp_path):
    run = make_fake_run(tmp_path / "run", recordings=2, windows=1)
    rows = load_runs([run])[0].rows
    (rows[0].results[0].folder / "predictions.npz").unlink()
    found, problems = locate_rows(row for row in rows if row.windows)
    assert len(found) == 5
    assert len(problems) == 1
    assert problems[0].startswith(f"BL-DC: {rows[0].results[0].folder / 'predictions.npz'}: cannot be read")
    with pytest.raises(ResultError):
        locate_row(rows[0])
