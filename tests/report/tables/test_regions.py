import numpy as np
import pytest
from semgrid_eval.report.tables.regions import region_frame, region_tables, score_regions
from support.fake_run import counted_row


def _rows():
    moving = {"BL-DC": [20, 40, 60, 0], "ED-DC": [30, 50, 70, 0]}
    return [
        counted_row(name, {"road": [50] * 4}, near={"moving": {"car": hits}, "standing": {"car": [80] * 4}})
        for name, hits in moving.items()
    ]


def test_near_moving_actors_only_their_cells_count():
    scores = score_regions(_rows(), 0)
    assert list(scores) == ["moving", "standing"]
    assert scores["moving"]["BL-DC"].mean["car"] == pytest.approx(120 / 400)
    assert scores["standing"]["BL-DC"].mean["car"] == pytest.approx(0.8)
    assert np.isnan(scores["moving"]["BL-DC"].mean["road"])


def test_windows_without_such_actors_are_no_evidence():
    row = counted_row("BL-DC", {"car": [50] * 4})
    near = counted_row("BL-DC", {"car": [10, 90, 0, 0]}).results[0].counts.copy()
    near[2:] = 0
    row.results[0].regions["moving"] = near
    entry = score_regions([row], 0)["moving"]["BL-DC"]
    assert entry.row.windows == 2
    assert [window.recording for window in entry.row.results[0].record.windows] == ["town_0", "town_1"]
    assert entry.mean["car"] == pytest.approx(0.5)


def test_differences_are_paired():
    table = region_frame(score_regions(_rows(), 0)).set_index(["region", "row", "score"])
    gap = table.loc[("moving", "ED-DC", "vehicles")]
    assert gap.reference == "BL-DC"
    assert gap.difference == pytest.approx(30 / 400)
    assert gap.difference_low > 0  # though the rows' own intervals overlap
    assert table.loc[("moving", "BL-DC", "vehicles")].iou_high > table.loc[("moving", "ED-DC", "vehicles")].iou_low
    assert table.loc[("standing", "ED-DC", "car")].difference == 0
    assert gap.cells == 400


def test_regions_stand_side_by_side():
    tables = region_tables(score_regions(_rows(), 0))
    notes = [note for _, note in tables["regions"].columns]
    assert notes[0] == "moving, 400 cells"
    assert notes[3] == "standing, 400 cells"
    (line,) = tables["region_differences"].bodies[0]
    assert line.header == "ED-DC \N{MINUS SIGN} BL-DC"
    assert [cell.tone for cell in line.cells] == ["gain", "open", "open", "open", "open", "open"]


def test_a_row_that_lacks_one_region_has_dashes_there():
    first, second = _rows()
    del second.results[0].regions["standing"]
    line = region_tables(score_regions([first, second], 0))["regions"].bodies[1][0]
    assert line.cells[0].text == "0.375"
    assert [cell.text for cell in line.cells[3:]] == ["\N{EN DASH}"] * 3


def test_without_truth_there_is_nothing_to_show():
    regions = score_regions([counted_row("BL-DC", {"car": [50]})], 0)
    assert regions == {}
    assert set(region_tables(regions).values()) == {None}
    assert region_frame(regions).empty
