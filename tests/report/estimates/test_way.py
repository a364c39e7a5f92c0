"""The share of the way to the ceiling and the second target: by hand, on the page and in its files."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support.fake_run import counted_row, reader
from support.scoring import score_rows

from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.estimates.way import Order, against_expected, order_of, ways
from semgrid_eval.report.figures.categories import category_plots, lay_out
from semgrid_eval.report.page.write import write_report
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import headline, main_group, reference_of, way_of
from semgrid_eval.report.tables.truth import order_sentence, way_sentence, way_table
from semgrid_eval.report.tables.values import best_rows


def row(name, hits, *, recordings=12, near=None, expected=None, **facts):
    """A row with as many hits of road and car in each recording, its facts changed."""
    values = hits if isinstance(hits, list) else [hits] * recordings
    made = counted_row(name, {"road": values, "car": values}, near=near)
    record = made.record.model_copy(update={"facts": made.record.facts.model_copy(update=facts)})
    results = made.results
    if expected is not None:
        other = counted_row(name, {"road": [expected] * recordings, "car": [expected] * recordings})
        results = (replace(results[0], read_expected=other.results[0].read),)
    return replace(made, record=record, results=results)


LOWER, UPPER, TOLD = {"bound": "lower"}, {"bound": "upper", "uses_truth": True, "baseline": False}, {"uses_truth": True}


def rows_of(model=70, **changes):
    return [
        row("BL-DC", 50, **LOWER),
        row("ED-DC", model, **changes),
        row("top", 90, **UPPER),
        row("new", 95, **TOLD, baseline=False),
    ]


def shares(rows, column="vehicles"):
    found = ways(score_rows(rows, np.random.default_rng(0)))
    return {entry.row.name: way.share(entry, column) for entry, way in found}


def test_the_share_is_how_far_a_row_has_come_from_the_lower_to_the_upper_end():
    assert shares(rows_of()) == {
        "ED-DC": Estimate(pytest.approx(0.5), pytest.approx(0.5), pytest.approx(0.5)),
        "new": Estimate(pytest.approx(1.125), pytest.approx(1.125), pytest.approx(1.125)),
    }
    assert shares(rows_of(40))["ED-DC"].value == pytest.approx(-0.25)


def test_all_three_rows_are_resampled_together():
    """Where recordings differ alike for all, the share does not; where one alone differs, it does."""
    places = np.arange(12)
    rows = [
        row("BL-DC", (50 - places).tolist(), **LOWER),
        row("ED-DC", (70 - places).tolist()),
        row("top", (90 - places).tolist(), **UPPER),
    ]
    alike = shares(rows)["ED-DC"]
    assert (alike.low, alike.high) == (pytest.approx(alike.value), pytest.approx(alike.value))
    rows[1] = row("ED-DC", (60 + 2 * places).tolist())
    apart = shares(rows)["ED-DC"]
    assert apart.low < apart.value - 0.02 < apart.value + 0.02 < apart.high


@pytest.mark.parametrize(
    "change",
    [
        {"horizon_steps": 2},
        {"step_frames": 3},
    ],
)
def test_rows_that_look_another_time_ahead_have_no_way(change):
    assert set(shares(rows_of(**change))) == {"new"}


def test_rows_of_other_targets_have_no_way_and_the_own_runs_ends_come_first():
    rows = rows_of()
    record = rows[1].results[0].record.model_copy(update={"targets": "others"})
    rows[1] = replace(rows[1], results=(replace(rows[1].results[0], record=record),))
    assert way_of(rows[1], rows) is None
    mine = [replace(each, run=each.run / "other") for each in rows_of()]
    assert way_of(mine[1], [*rows_of(), *mine]) == (mine[0], mine[2])
    assert way_of(mine[1], rows_of()) is not None


def test_there_is_no_way_where_an_end_is_missing_or_is_not_above_the_other():
    rows = rows_of()
    assert shares(rows[:2]) == shares(rows[1:]) == {}
    level = [row("BL-DC", 50, **LOWER), row("ED-DC", 60), row("top", 50, **UPPER)]
    assert np.isnan(shares(level)["ED-DC"].value)


def test_the_lower_end_has_inputs_in_the_targets_place():
    rows = [row("BL-NT", 30, **LOWER, translate=False), *rows_of()]
    lower, upper = way_of(rows[2], rows)
    assert (lower.name, upper.name) == ("BL-DC", "top")


def test_the_upper_end_that_sees_the_same_inputs_is_nearer_and_of_several_the_first_is_taken():
    rows = [*rows_of(), row("again", 91, **UPPER), row("top-5", 92, **UPPER, inputs=5), row("ED-5", 80, inputs=5)]
    assert [way_of(each, rows)[1].name for each in (rows[1], rows[-1])] == ["top", "top-5"]


def test_who_is_told_of_the_truth_is_never_best_nor_a_baseline_nor_in_the_main_group():
    rows = rows_of()
    scores = score_rows(rows, np.random.default_rng(0))
    found = headline(scores)
    assert (found.best.name, found.rival.name, found.compared) == ("ED-DC", "BL-DC", 2)
    assert best_rows(scores, "vehicles") == {"ED-DC"}
    assert [each.name for each in main_group(rows)] == ["BL-DC", "ED-DC"]
    assert reference_of(rows[1], rows).name == "BL-DC"
    assert headline(score_rows(rows[2:], np.random.default_rng(0))) is None


def test_the_page_says_how_far_the_best_row_has_come():
    scores = score_rows(rows_of(), np.random.default_rng(0))
    text = way_sentence(scores, headline(scores).best)
    assert text == "Knowing the world exactly gives 0.900 (top): ED-DC has covered 50% of the way there from BL-DC."
    assert way_sentence(score_rows(rows_of()[:2], np.random.default_rng(0)), None) == ""


def test_the_table_has_shares_of_all_cells_and_near_moving_actors():
    scores = score_rows(rows_of(), np.random.default_rng(0))
    moving = score_rows(
        [row("BL-DC", 20, **LOWER), row("ED-DC", 26), row("top", 40, **UPPER)], np.random.default_rng(0)
    )
    table = way_table(scores, moving, [entry.row for entry in scores.values()])
    found = {body[0].header: [cell.text for cell in body[0].cells] for body in table.bodies}
    assert table.caption.startswith("Share of the way from BL-DC to top that each row has covered")
    absent = "\N{EN DASH}"
    assert found["ED-DC"] == ["50%", "50%", absent, "50%", absent, "30%", absent, absent]
    assert found["new"][-3:] == [absent] * 3
    assert "from BL-DC 0.500 to top 0.900" in table.bodies[0][0].cells[0].title
    assert way_table(score_rows(rows_of()[:2], np.random.default_rng(0)), {}, []) is None


def test_figures_draw_who_is_told_as_lines_across_the_bars():
    scores = score_rows(rows_of(), np.random.default_rng(0))
    (group,) = lay_out(scores)
    assert list(group.places) == ["BL-DC", "ED-DC"]
    assert [entry.row.name for entry in group.told] == ["top", "new"]
    (plot,) = category_plots(scores)
    assert "told of the truth" in plot.caption
    assert category_plots(score_rows(rows_of()[2:], np.random.default_rng(0))) == []


def test_rows_are_ordered_against_both_targets_without_those_who_are_told():
    rows = [row("a", 60, expected=60), row("b", 50, expected=70), row("c", 40, expected=50), row("d", 99)]
    rows.append(row("top", 90, expected=99, **UPPER))
    measured = score_rows(rows, np.random.default_rng(0))
    expected = score_rows(against_expected(rows), np.random.default_rng(0))
    assert set(expected) == {"a", "b", "c", "top"}
    assert expected["b"].mean["vehicles"] == pytest.approx(0.7)
    order = order_of(measured, expected, "targets")
    assert order == Order(("a", "b", "c"), ("b", "a", "c"))
    assert order.swapped == [("a", "b")]
    text = order_sentence(measured, expected, order)
    assert text.startswith("The order of the 3 rows by mean class IoU changes: a and b change places")
    same = Order(("a", "b"), ("a", "b"))
    assert order_sentence(measured, expected, same) == "The order of the 2 rows by mean class IoU stays the same."


@pytest.mark.slow
def test_files_have_the_shares_and_the_second_target(told_run, tmp_path):
    page = write_report(told_run, tmp_path / "report")
    summary = (
        pd.read_csv(page.parent / "summary.csv")
        .set_index(["metric", "division", "region", "row", "column"])
        .sort_index()
    )
    line = summary.loc[("iou", "all", "all", "BL-Fuse", "mean_known")]
    scores = {row.name: row for row in load_runs([told_run])[0].rows}
    assert {"BL-DC", "BL-Fuse", "top"} <= set(scores)
    low, high = (summary.loc[("iou", "all", "all", name, "mean_known")].value for name in ("BL-DC", "top"))
    assert line["share"] == pytest.approx((line.value - low) / (high - low), abs=1e-4)
    assert line.share_low <= line["share"] <= line.share_high
    assert np.isnan(summary.loc[("iou", "all", "all", "top", "mean_known")]["share"])
    expected = pd.read_csv(page.parent / "expected.csv").set_index(["division", "region", "row", "column"]).sort_index()
    assert (
        expected.loc[("all", "all", "new", "vehicles")].value
        > summary.loc[("iou", "all", "all", "new", "vehicles")].value
    )
    record = json.loads((page.parent / "report.json").read_text())
    assert "The order of the 2 rows" in record["expected"]["order"]
    assert record["rows"]["BL-Fuse"]["shares"]["mean_known"]["value"] == pytest.approx(line["share"], abs=1e-4)
    text = page.read_text()
    assert 'id="table-way"' in text
    assert 'id="table-expected"' in text
    assert "Knowing the world exactly gives" in text


@pytest.fixture(scope="module")
def told_run(tmp_path_factory):
    from support.drawn_again import write_town_like
    from support.small_runs import run

    folder = tmp_path_factory.mktemp("told")
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "BL-Fuse", "model": "fuse"}]
    rows += [{"name": "top", "model": "ceiling"}, {"name": "new", "model": "fresh"}]
    run(rows, write_town_like(folder / "logs"), folder / "run", second_target="expected")
    return folder / "run"


@pytest.mark.slow
def test_without_the_second_target_nothing_is_said_of_it(run, tmp_path):
    page = write_report(run, tmp_path / "report")
    text = page.read_text()
    assert 'id="table-expected"' not in text
    assert "No row here is told the truth" in text
    assert pd.read_csv(page.parent / "expected.csv").empty


def test_reading_the_second_target_is_left_to_results_that_have_it():
    plain = row("a", 60)
    assert against_expected([plain]) == []
    sums = {("iou", "all"): plain.results[0].counts[:, None]}
    both = replace(plain, results=(replace(plain.results[0], read_expected=reader(sums)),))
    assert [each.name for each in against_expected([both])] == ["a"]
