from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import FakeRow, counted_row, make_fake_run
from support.scoring import score_rows

from semgrid_eval.report.estimates.bootstrap import Resampling, score_regions
from semgrid_eval.report.estimates.division import EVERYWHERE, of_cells
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.values import (
    best_rows,
    difference_table,
    reference_scores,
    run_differences,
    short_count,
    side_by_side,
    value_table,
)
from semgrid_eval.scores.metrics.table import CALIBRATION, IOU, METRICS
from semgrid_eval.scores.regions.actors import ACTORS
from semgrid_eval.scores.regions.origin import ORIGIN

SHOWN = ("vehicles", "person", "bicycle")


@pytest.fixture(scope="module")
def scores(run):
    return score_rows(load_runs([run])[0].rows, 0, draws=50)


def near_actors(rows):
    return score_regions(rows, IOU, of_cells(ACTORS), Resampling(0))


def value_parts(parts):
    return {part: value_table("regions", "", scores, SHOWN) for part, scores in parts.items()}


def difference_parts(parts):
    return {part: difference_table("differences", "", scores, SHOWN) for part, scores in parts.items()}


def two_rows():
    moving = {"BL-DC": [20, 40, 60, 0], "ED-DC": [30, 50, 70, 9]}
    return [
        counted_row(name, {"road": [50] * 4}, near={"moving": {"car": hits}, "standing": {"car": [80] * 4}})
        for name, hits in moving.items()
    ]


def on_targets(row, targets, name=None):
    results = tuple(replace(r, record=r.record.model_copy(update={"targets": targets})) for r in row.results)
    return replace(row, results=results, name=name or row.name)


def test_differences_are_marked_where_they_are_sure(scores):
    table = difference_table("differences", "", scores, ("vehicles",))
    assert [body[0].header for body in table.bodies] == ["ED-DC \N{MINUS SIGN} BL-DC", "ED-Sp2 \N{MINUS SIGN} BL-Sp2"]
    assert table.bodies[0][0].cells[0].tone == "gain"


def test_the_best_is_the_best_of_rows_with_the_same_targets():
    low, high, other, alone = (
        counted_row(name, {"car": [hits] * 3}) for name, hits in (("A-1", 10), ("A-2", 30), ("A-3", 80), ("A-4", 90))
    )
    rows = [
        low,
        high,
        on_targets(other, "b"),
        on_targets(counted_row("A-5", {"car": [20] * 3}), "b"),
        on_targets(alone, "c"),
    ]
    scores = score_rows(rows, 0, draws=2)
    assert best_rows(scores, "car") == {"A-2", "A-3"}
    assert "not compared with each other" in value_table("", "", scores, ("car",)).caption
    assert best_rows(score_rows([alone], 0, draws=2), "car") == {"A-4"}


def test_a_row_has_no_baseline_on_other_targets():
    baseline, row = two_rows()
    scores = score_rows([baseline, on_targets(row, "other")], 0, draws=5)
    assert reference_scores(scores["ED-DC"], scores) is None
    assert difference_table("", "", scores, ("road",)) is None
    same = score_rows([baseline, row], 0, draws=5)
    assert reference_scores(same["ED-DC"], same) is same["BL-DC"]


def test_where_cells_hang_on_the_inputs_rows_of_other_inputs_are_not_compared(tmp_path):
    kinds = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 1), FakeRow("SL3", "ED", 0.2, 1, inputs=3))
    rows = load_runs([make_fake_run(tmp_path / "run", rows=kinds, recordings=2)])[0].rows
    everywhere = score_regions(rows, METRICS["accuracy"], EVERYWHERE, Resampling(0, draws=5))["all"]
    seen = score_regions(rows, METRICS["accuracy"], of_cells(ORIGIN), Resampling(0, draws=5))["in the newest input"]
    references = [
        [other and other.row.name for other in (reference_scores(scores[name], scores) for name in ("ED-DC", "ED-SL3"))]
        for scores in (everywhere, seen)
    ]
    assert references == [["BL-DC", "BL-DC"], ["BL-DC", None]]
    assert best_rows(seen, "right") == {"BL-DC"}


def test_the_baseline_of_a_row_is_the_same_in_all_regions(tmp_path):
    kinds = (FakeRow("DC", "BL"), FakeRow("NT", "BL", translate=False), FakeRow("NT", "ED", 0.1, 1, translate=False))
    rows = load_runs([make_fake_run(tmp_path / "run", rows=kinds, recordings=2)])[0].rows
    scores = score_regions(rows, IOU, EVERYWHERE, Resampling(0, draws=5))["all"]
    assert reference_scores(scores["ED-NT"], scores, rows).row.name == "BL-NT"
    without = {name: entry for name, entry in scores.items() if name != "BL-NT"}
    assert reference_scores(scores["ED-NT"], without, rows) is None  # and not BL-DC


def test_runs_are_subtracted_where_they_share_their_model_and_targets(scores):
    rows = [entry.row for entry in scores.values()]
    again = [replace(row, name=f"{row.name} (2)") for row in rows]
    others = [on_targets(row, "other", f"{row.name} (3)") for row in rows]
    models = [
        replace(row, name=f"{row.name} (4)", record=row.record.model_copy(update={"facts": facts}))
        for row in rows
        for facts in [row.record.facts.model_copy(update={"model": "another"})]
    ]
    table = run_differences("runs", "", score_rows([*rows, *again, *others, *models], 0, draws=5), ("road",))
    assert [body[0].header for body in table.bodies] == [f"{row.name} (2) \N{MINUS SIGN} {row.name}" for row in rows]


def test_where_the_lower_value_is_the_better_one_a_fall_is_a_gain(scores):
    rows = [entry.row for entry in scores.values()]
    found = score_regions(rows, CALIBRATION, EVERYWHERE, Resampling(0, draws=100))["all"]
    errors = {name: entry.mean["calibration_error"] for name, entry in found.items()}
    assert best_rows(found, "calibration_error") == {min(errors, key=errors.get)}
    assert best_rows(found, "certainty") == set()
    table = difference_table("", "", found, ("calibration_error", "certainty"))
    for body in table.bodies:
        error, certainty = body[0].cells
        assert error.tone == (
            "open"
            if not error.interval or error.interval[0] <= 0 <= error.interval[1]
            else "gain"
            if error.sort < 0
            else "loss"
        )
        assert certainty.tone == ""


def test_near_moving_actors_only_their_cells_count():
    scores = near_actors(two_rows())
    assert list(scores) == ["moving", "standing"]
    assert scores["moving"]["BL-DC"].mean["car"] == pytest.approx(120 / 400)
    assert scores["standing"]["BL-DC"].mean["car"] == pytest.approx(0.8)
    assert np.isnan(scores["moving"]["BL-DC"].mean["road"])


def test_differences_are_paired():
    near = near_actors(two_rows())["moving"]
    gap = near["ED-DC"].minus(near["BL-DC"], "vehicles")
    assert gap.value == pytest.approx(39 / 400)
    assert gap.low > 0  # though the rows' own intervals overlap
    assert near["BL-DC"].estimate("vehicles").high > near["ED-DC"].estimate("vehicles").low


def test_regions_stand_side_by_side():
    parts = near_actors(two_rows())
    notes = [note for _, note in side_by_side(value_parts(parts)).columns]
    assert notes[0] == "moving, 400 cells"
    assert notes[3] == "standing, 400 cells"
    (line,) = side_by_side(difference_parts(parts)).bodies[0]
    assert line.header == "ED-DC \N{MINUS SIGN} BL-DC"
    assert [cell.tone for cell in line.cells] == ["gain", "open", "open", "open", "open", "open"]


def test_a_row_that_lacks_one_region_has_dashes_there():
    first, second = two_rows()
    sums = second.results[0].read("iou", "actors").copy()
    sums[:, 1] = 0
    second = replace(second, results=(replace(second.results[0], read=lambda *_: sums),))
    line = side_by_side(value_parts(near_actors([first, second]))).bodies[1][0]
    assert line.cells[0].text == "0.398"
    assert [cell.text for cell in line.cells[3:]] == ["\N{EN DASH}"] * 3


def test_without_regions_there_is_nothing_to_show():
    assert side_by_side({}) is None


@pytest.mark.parametrize(("count", "text"), [(999, "999"), (9999, "9,999"), (31_533, "31.5 k"), (4_586_444, "4.59 M")])
def test_large_counts_are_short(count, text):
    assert short_count(count) == text
