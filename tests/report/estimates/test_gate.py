"""A gate of two runs: what holds, what does not, and what cannot be compared."""

import numpy as np
import pytest
from support.fake_run import FakeRow, counted_row, make_fake_run

from semgrid_eval.errors import InputError
from semgrid_eval.report.estimates.bootstrap import SEED, Resampling, everywhere, score_all
from semgrid_eval.report.estimates.division import EVERYWHERE
from semgrid_eval.report.estimates.gate import Gate, Limit, Verdict, check_gate, hold, parse_limit
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import IOU

GOOD, BAD = FakeRow("DC", "ED", 0.06, 1), FakeRow("DC", "ED", 0.3, 1)
BASE = FakeRow("DC", "BL")
MEAN = Limit("mean_known", -0.01)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of runs by name; those of four recordings have the same targets."""
    folder = tmp_path_factory.mktemp("runs")
    rows = {
        "good": (BASE, GOOD),
        "bad": (BASE, BAD),
        "renamed": (BASE, FakeRow("new", "ED", 0.3, 1)),
        "failed": (BASE, FakeRow("DC", "ED", failure="out of memory")),
        "finer": (BASE, FakeRow("DC", "ED", 0.06, 1, cell_m=0.4)),
    }
    for name, these in rows.items():
        make_fake_run(folder / name, rows=these, recordings=4, windows=1)
    for name, many in (("one", 1), ("three", 3)):
        make_fake_run(folder / name, rows=(BASE, GOOD), recordings=many, windows=1)
    return folder


def gate(runs, before, after, *limits, **options):
    return check_gate((runs / before, runs / after), limits or (MEAN,), **options)


def test_a_run_holds_against_itself_and_its_differences_are_nothing(runs):
    found = gate(runs, "good", "good", MEAN, Limit("vehicles", 0.0))
    assert found.holds
    assert [(each.row, each.limit.column) for each in found.verdicts] == [
        (row, column) for row in ("BL-DC", "ED-DC") for column in ("mean_known", "vehicles")
    ]
    assert {each.difference for each in found.verdicts} == {Estimate(0.0, 0.0, 0.0)}


def test_the_row_that_is_worse_fails_and_the_better_one_holds(runs):
    worse = gate(runs, "good", "bad")
    assert [each.holds for each in worse.verdicts] == [True, False]
    assert not worse.holds
    assert gate(runs, "bad", "good").holds
    assert gate(runs, "good", "bad", Limit("mean_known", -0.9)).holds


def test_differences_are_those_of_a_report_of_both_runs(runs):
    found = gate(runs, "good", "bad", rows=("ED-DC",)).verdicts[0].difference
    loaded = load_runs((runs / "good", runs / "bad"))
    rows = [row for run in loaded for row in run.rows]
    scores = everywhere(score_all(rows, [EVERYWHERE], Resampling(SEED)), "iou")
    one, other = (run.rows[1].name for run in loaded)
    assert found == scores[other].minus(scores[one], "mean_known")


@pytest.mark.parametrize(
    ("high", "holds"), [(-0.02, False), (-0.010001, False), (-0.01, True), (0.0, True), (np.nan, False)]
)
def test_a_limit_fails_where_the_whole_interval_lies_below_it(high, holds):
    verdict = Verdict("ED-DC", MEAN, Estimate(-0.05, -0.09, high))
    assert verdict.holds is holds
    assert Gate((verdict,), ()).holds is holds
    assert ("is clearly below -0.0100" in str(verdict)) is not holds


def test_rows_are_chosen_by_name_by_pattern_or_as_pairs(runs):
    def compared(after, *rows):
        return [each.row for each in gate(runs, "good", after, rows=rows).verdicts]

    assert compared("bad", "ED-DC") == ["ED-DC"]
    assert compared("bad", "*-DC", "BL-DC") == ["BL-DC", "ED-DC"]
    assert compared("renamed", "ED-DC=ED-new") == ["ED-new"]
    with pytest.raises(InputError, match=r"row: 'ED-DD' is not a row of both runs: BL-DC, ED-DC; did you mean ED-DC\?"):
        gate(runs, "good", "bad", rows=("ED-DD",))


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        ("ED-DC=ED-DC", r"renamed: row: 'ED-DC' is not one of BL-DC, ED-new"),
        ("ED-DC=ED-nwe", r"renamed: row: 'ED-nwe' is not one of BL-DC, ED-new; did you mean ED-new\?"),
        ("ED-D=ED-new", r"good: row: 'ED-D' is not one of BL-DC, ED-DC; did you mean ED-DC\?"),
        ("ED=RN", r"good: row: 'ED' is not one of BL-DC, ED-DC"),
    ],
)
def test_of_a_pair_the_name_that_is_wrong_is_said(runs, asked, fault):
    with pytest.raises(InputError, match=fault):
        gate(runs, "good", "renamed", rows=(asked,))


def test_a_row_that_the_later_run_does_not_have_is_named(runs):
    found = gate(runs, "good", "renamed")
    assert found.missing == ("ED-DC",)
    assert [each.row for each in found.verdicts] == ["BL-DC"]


def test_a_row_that_has_failed_later_is_refused_and_one_that_failed_before_is_not_compared(runs):
    with pytest.raises(InputError, match="failed: row ED-DC has no result to compare: out of memory"):
        gate(runs, "good", "failed")
    assert [each.row for each in gate(runs, "failed", "good").verdicts] == ["BL-DC"]
    with pytest.raises(InputError, match="row ED-DC has no result"):
        gate(runs, "failed", "good", rows=("ED-DC",))


def test_rows_with_other_targets_are_refused_with_what_differs(runs):
    with pytest.raises(
        InputError, match=r"finer: row ED-DC has other targets than in .*good: grid.cell_m 0.78125 to 0.4"
    ):
        gate(runs, "good", "finer")
    with pytest.raises(InputError, match=r"three: row BL-DC has other targets than in .*: other logs or frames"):
        gate(runs, "good", "three")


def test_what_no_limit_could_be_held_to_is_refused(runs):
    with pytest.raises(
        InputError, match="row BL-DC: one recording alone has cells of mean_known: an interval needs more"
    ):
        gate(runs, "one", "one")
    rows = counted_row("one", {"car": [50, 50]}), counted_row("other", {"car": [40, 40]})
    with pytest.raises(InputError, match="row other has no cell of road"):
        hold([rows], [Limit("road", 0.0)], Resampling())


def test_what_is_lost_is_counted_in_iou():
    """Each recording has 100 cells of a car; 50 of them are found before and 40 later."""
    rows = counted_row("one", {"car": [50, 50, 50]}), counted_row("other", {"car": [40, 40, 40]})
    verdicts = hold([rows], [Limit("car", -0.11), Limit("car", -0.09)], Resampling())
    assert [each.difference.value for each in verdicts] == pytest.approx([-0.1, -0.1])
    assert [each.holds for each in verdicts] == [True, False]
    assert str(verdicts[1]) == "other, car: -0.1000 [-0.1000, -0.1000] is clearly below -0.0900"


def test_a_loss_in_one_recording_alone_is_not_clear():
    rows = counted_row("one", {"car": [50, 50, 50]}), counted_row("other", {"car": [50, 50, 20]})
    (verdict,) = hold([rows], [Limit("car", -0.05)], Resampling())
    assert verdict.difference.value == pytest.approx(-0.1)
    assert verdict.holds


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("vehicles: -0.01", Limit("vehicles", -0.01)),
        (" road:0", Limit("road", 0.0)),
        ("mean_known : -1e-3", Limit("mean_known", -0.001)),
    ],
)
def test_limits_are_a_column_and_what_it_may_lose(text, limit):
    assert parse_limit(text, IOU.labels) == limit


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("vehicles", "'vehicles' is not of the form 'vehicles: -0.01'"),
        ("vehicles: much", "'vehicles: much' is not of the form"),
        ("vehicles: nan", "'vehicles: nan' is not of the form"),
        ("vehicle: -0.01", "'vehicle' is not one of unknown, road, .*; did you mean vehicles?"),
        ("vehicles: 0.01", "'vehicles: 0.01': what may be lost of an IoU is a number from -1 to 0"),
        ("vehicles: -5", "'vehicles: -5': what may be lost"),
    ],
)
def test_a_limit_that_cannot_be_is_one_line(text, fault):
    with pytest.raises(InputError, match=f"^fail-below: {fault}"):
        parse_limit(text, IOU.labels)
