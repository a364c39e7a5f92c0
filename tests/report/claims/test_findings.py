from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.fake_run import FakeRow, counted_row, make_fake_run
from support.scoring import score_rows

from semgrid_eval.report.claims.claims import MARGIN, claims
from semgrid_eval.report.claims.findings import (
    SAME_TARGETS,
    TRUTH,
    Verdict,
    find,
    finding_frame,
    finding_records,
    finding_table,
    judge,
    missing_table,
    sentence,
)
from semgrid_eval.report.estimates.bootstrap import Resampling, score_regions
from semgrid_eval.report.estimates.division import of_cells
from semgrid_eval.report.estimates.intervals import Estimate
from semgrid_eval.report.rows.load import Run, load_runs
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.regions.actors import ACTORS

RECORDINGS = 12
HOLDS, FAILS, OPEN, NOT_RUN = Verdict.HOLDS, Verdict.FAILS, Verdict.OPEN, Verdict.NOT_RUN
MIXED = [20, 80] * (RECORDINGS // 2)


def _hits(value, *, small=40, car=None):
    """Hits of 100 in every recording: of static classes, of small ones, of cars."""
    each = {"road": value, "car": value if car is None else car, "pole_sign": small, "person": small}
    return {name: hits if isinstance(hits, list) else [hits] * RECORDINGS for name, hits in each.items()}


def _near(rows):
    return score_regions(rows, IOU, of_cells(ACTORS), Resampling(0))


def _findings(*rows):
    run = Run(Path(), "", None, tuple(rows))
    scores = score_rows(rows, np.random.default_rng(0), draws=200)
    return {each.claim.name: each for each in find([run], scores, _near(rows))}


def _row(name, value=50, **kwargs):
    return counted_row(name, _hits(value, **kwargs))


@pytest.mark.parametrize(
    ("first", "others"),
    [
        ("RN-DC", ("BL-DC", "BL-Fuse", "BL-Table", "BL-Flow", "ED-DC")),
        ("RN-Flow-DC", ("BL-DC", "BL-Fuse", "BL-Table", "BL-Flow", "ED-DC")),
        ("RN-SL5", ("BL-DC", "BL-Flow", "BL-Fuse-SL5", "ED-SL5")),
        ("RN-Flow-SL5", ("BL-DC", "BL-Flow", "BL-Fuse-SL5", "ED-SL5")),
    ],
)
def test_the_residual_network_has_to_be_above_each_of_its_rivals_in_every_category_and_near_moving_actors(
    first, others
):
    rivals = [_row(other, 50) for other in others[:-1]] + [_row(others[-1], 50, small=60)]
    found = _findings(_row(first, 60, small=[*[50] * (RECORDINGS - 2), 55, 60]), *rivals)
    for other in others[:-1]:
        claim = found[f"{first}-{other}"]
        assert claim.verdict is HOLDS
        assert [each.check.score for each in claim.outcomes] == [
            "static_known", "vehicles", "small_static", "small_dynamic"
        ]  # fmt: skip
    assert found[f"{first}-{others[-1]}"].verdict is FAILS
    for other in others:
        near = found[f"{first}-moving-{other}"].claim.checks
        assert [(check.score, check.region) for check in near] == [("vehicles", "moving"), ("person", "moving")]


def test_a_claim_holds_where_every_interval_excludes_zero():
    found = _findings(_row("BL-DC", 50), _row("ED-DC", 60))["large-BL-DC"]
    assert found.verdict is HOLDS
    assert [outcome.check.score for outcome in found.outcomes] == ["static_known", "vehicles"]
    for outcome in found.outcomes:
        assert (outcome.difference.value, outcome.difference.low, outcome.difference.high) == pytest.approx((0.1,) * 3)
        assert outcome.windows == RECORDINGS


def test_a_claim_does_not_hold_where_one_of_its_comparisons_fails():
    found = _findings(_row("BL-DC", 50), _row("ED-DC", 60, car=45))["large-BL-DC"]
    assert [outcome.verdict for outcome in found.outcomes] == [HOLDS, FAILS]
    assert found.verdict is FAILS


def test_a_claim_is_undecided_where_an_interval_includes_zero():
    found = _findings(_row("BL-DC", 50), _row("ED-DC", 60, car=MIXED))["large-BL-DC"]
    assert [outcome.verdict for outcome in found.outcomes] == [HOLDS, OPEN]
    assert found.verdict is OPEN


def test_a_claim_is_not_run_without_its_rows_and_names_them():
    found = _findings(_row("BL-DC"))
    assert {each.verdict for each in found.values()} == {NOT_RUN}
    assert found["large-BL-Fuse"].missing == ("ED-DC", "BL-Fuse")
    assert found["horizon-falls"].missing == ("ED-DC", "ED-PH1", "ED-PH2", "ED-PH3")
    assert found["deeper-better"].missing == ("ED-d4-f64", "ED-d2-f64")


def _named(row, name):
    return replace(row, name=name, record=row.record.model_copy(update={"name": name}))


def test_rows_are_found_by_the_names_of_the_presets_alone():
    assert _findings(_row("BL-DC"), _named(_row("ED-DC", 60), "mine"))["large-BL-DC"].missing == ("ED-DC",)


def test_rows_with_other_targets_decide_no_claim():
    fine = _row("ED-DC", 60)
    record = fine.results[0].record.model_copy(update={"targets": "of a finer grid"})
    fine = replace(fine, results=(replace(fine.results[0], record=record),))
    found = _findings(_row("BL-DC"), fine)["large-BL-DC"]
    assert (found.verdict, found.missing) == (NOT_RUN, (SAME_TARGETS,))


def test_a_claim_that_is_run_in_part_fails_but_does_not_hold():
    falls, rises = (_findings(_row("ED-DC", 60), _row("ED-PH1", value))["horizon-falls"] for value in (50, 70))
    assert falls.verdict is NOT_RUN
    assert falls.outcomes[0].verdict is HOLDS
    assert rises.verdict is FAILS


def test_one_recording_decides_nothing():
    rows = [counted_row(name, {"road": [value], "car": [value]}) for name, value in (("BL-DC", 20), ("ED-DC", 90))]
    assert _findings(*rows)["large-BL-DC"].verdict is OPEN


def test_claims_are_stated_against_the_stronger_baselines_too():
    found = _findings(
        _row("BL-DC", 40), _row("BL-Fuse", 50), _row("BL-Table", 60), _row("BL-Flow", 55), _row("ED-DC", 55)
    )
    verdicts = [found[f"large-BL-{name}"].verdict for name in ("DC", "Fuse", "Table", "Flow")]
    assert verdicts == [HOLDS, HOLDS, FAILS, OPEN]


@pytest.mark.parametrize(("small", "expected"), [(41, HOLDS), (39, HOLDS), (37, FAILS), (MIXED, OPEN)])
def test_at_least_equal_forgives_a_loss_within_the_margin(small, expected):
    assert _findings(_row("BL-DC"), _row("ED-DC", small=small))["small-BL-DC"].verdict is expected


@pytest.mark.parametrize(("value", "expected"), [(51, HOLDS), (49, HOLDS), (55, FAILS), (45, FAILS), (MIXED, OPEN)])
def test_close_needs_the_whole_interval_within_the_margin(value, expected):
    assert _findings(_row("ED-DC"), _row("ED-NT", value))["untranslated-large"].verdict is expected


def test_leads_over_baselines_are_compared():
    rows = [_row("BL-DC", 50), _row("ED-DC", 60), _row("BL-Sp2", 20), _row("ED-Sp2", 40)]
    found = _findings(*rows)
    (check,) = found["blind-band-static"].outcomes
    assert check.difference.value == pytest.approx((0.40 - 0.20) - (0.60 - 0.50))
    assert {found[name].verdict for name in ("blind-band", "blind-band-lead", "blind-band-static")} == {HOLDS}
    assert _findings(*rows[:3], _row("ED-Sp2", 25))["blind-band-lead"].verdict is FAILS


def test_moving_vehicles_are_judged_by_the_cells_near_them_alone():
    rows = [
        counted_row(name, _hits(50), near={"moving": _hits(moving), "standing": _hits(standing)})
        for name, moving, standing in (("BL-DC", 40, 60), ("BL-Fuse", 45, 80), ("ED-DC", 43, 90))
    ]
    found = _findings(*rows)
    assert found["moving-BL-DC"].verdict is HOLDS
    assert found["moving-BL-Fuse"].verdict is FAILS
    assert found["large-BL-DC"].verdict is OPEN


def test_moving_vehicles_need_the_truth():
    found = _findings(_row("BL-DC"), _row("ED-DC", 60))["moving-BL-DC"]
    assert (found.verdict, found.missing) == (NOT_RUN, (TRUTH,))


def _network(depth, features, value, window_ms):
    return counted_row(f"ED-d{depth}-f{features}", _hits(value), window_ms=window_ms)


def test_deeper_and_wider_networks_are_compared_at_their_ends():
    builds = [_network(d, f, 30 + 5 * d + f // 16, d + f / 10) for d in (2, 3, 4) for f in (16, 64)]
    found = _findings(*builds)
    (better,), (slower,) = found["deeper-better"].outcomes, found["deeper-slower"].outcomes
    assert better.check.pairs == (("ED-d4-f16", "ED-d2-f16"), ("ED-d4-f64", "ED-d2-f64"))
    assert better.difference.value < 0.1  # mean over the classes, of which the small ones stay as they are
    assert slower.difference.value == pytest.approx(2.0)
    names = ("deeper-better", "deeper-slower", "wider-better", "wider-slower")
    assert {found[name].verdict for name in names} == {HOLDS}


def test_times_of_one_pair_or_of_pairs_that_disagree_decide_nothing():
    pair = [_network(2, 16, 50, 3.0), _network(4, 16, 50, 9.0)]
    more = [_network(2, 32, 50, 9.0), _network(4, 32, 50, 8.0)]
    assert _findings(*pair)["deeper-slower"].verdict is OPEN
    assert _findings(*pair, *more)["deeper-slower"].verdict is OPEN
    assert _findings(*pair)["wider-better"].verdict is NOT_RUN


ROWS = [row.name for name in ("paper-cpu", "architecture") for row in load_matrix(name).rows]


def _rows_for(claim, wanted):
    """Make the claim's rows: scores and times fall from row to row, rise or waver; leads compared with are none."""
    names = list(dict.fromkeys(name for check in claim.checks for pair in check.pairs for name in pair))
    descending = [70 - 4 * place for place in range(len(names))]
    level = [50] * len(names)
    close = claim.checks[0].rule == "close"
    values = {HOLDS: level if close else descending, FAILS: descending[::-1], OPEN: [MIXED, *level[1:]]}[wanted]
    times = [9.0, 3.0, 3.0, 9.0] * len(names) if wanted is OPEN else values
    others = {name for check in claim.checks for name in check.over or ()} - set(names)
    for name, value, ms in [*zip(names, values, times, strict=False), *((name, 50, 1.0) for name in others)]:
        hits = _hits(value, small=value)
        yield counted_row(name, hits, near={"moving": hits, "standing": hits}, window_ms=ms)


@pytest.mark.parametrize("wanted", [HOLDS, FAILS, OPEN])
@pytest.mark.parametrize("claim", claims(ROWS), ids=lambda claim: claim.name)
def test_every_claim_can_hold_fail_and_stay_undecided(claim, wanted):
    run = Run(Path(), "", None, tuple(_rows_for(claim, wanted)))
    builds = [row.name for row in run.rows if row.name.startswith("ED-d")]
    scores = score_rows(run.rows, np.random.default_rng(0), draws=100)
    found = {each.claim.name: each for each in find([run], scores, _near(run.rows))}[claim.name]
    assert found.claim.checks == next(c.checks for c in claims(builds or ROWS) if c.name == claim.name)
    assert found.verdict is wanted, [(o.check.text, o.verdict, o.difference) for o in found.outcomes]


@given(st.floats(-1, 1), st.floats(0, 1))
def test_no_interval_both_holds_and_fails(low, width):
    difference = Estimate(low + width / 2, low, low + width)
    assert (judge("better", difference) is HOLDS) == (low > 0)
    assert (judge("close", difference) is HOLDS) == (low > -MARGIN and low + width < MARGIN)
    if judge("better", difference) is HOLDS:
        assert judge("at least", difference) is HOLDS
    if judge("at least", difference) is FAILS:
        assert judge("close", difference) is FAILS


def test_every_claim_has_its_own_name_and_says_its_margin():
    found = claims(["ED-d2-f16", "ED-d3-f16"])
    assert len({claim.name for claim in found}) == len(found)
    for claim in found:
        if {check.rule for check in claim.checks} & {"close", "at least"}:
            assert str(MARGIN) in claim.text


def test_presets_name_every_row_that_a_claim_needs():
    needed = {name for claim in claims(ROWS) for check in claim.checks for name in check.weights}
    assert needed <= set(ROWS)


def test_tables_and_records_tell_the_same():
    found = list(_findings(_row("BL-DC", 50), _row("ED-DC", 60, car=45)).values())
    tested, missing = finding_table("findings", found), missing_table("not-run", found)
    assert [body[0].header for body in tested.bodies] == [
        each.claim.text for each in found if each.verdict is not NOT_RUN
    ]
    assert len(tested.bodies) + len(missing.bodies) == len(found)
    assert [cell.text for cell in tested.bodies[0][2].cells[:2]] == ["does not hold", "Vehicles"]
    frame, records = finding_frame(found), finding_records(found)
    assert frame.verdict.tolist() == [each["verdict"] for each in records for _ in each["checks"]]
    assert frame[frame.name == "large-BL-DC"].comparison_verdict.tolist() == ["holds", "does not hold"]
    whose = "Of 61 claims, the paper's and ours about stronger baselines"
    assert sentence(found) == f"{whose}, 2 can be tested here: 1 holds, 1 does not, 0 are undecided."


def test_each_run_has_its_own_findings(tmp_path):
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.05, 1))
    folders = [
        make_fake_run(tmp_path / "one", rows=rows, recordings=3),
        make_fake_run(tmp_path / "two", rows=rows[:1], recordings=3),
    ]
    runs = load_runs(folders)
    every = [row for run in runs for row in run.rows]
    found = find(runs, score_rows(every, np.random.default_rng(0), draws=20), _near(every))
    assert {each.run for each in found if each.verdict is not NOT_RUN} == {"one"}
    assert {each.run for each in found} == {"one", "two"}
    captions = {
        table(tag, [f for f in found if f.run == tag]).caption
        for table in (finding_table, missing_table)
        for tag in ("one", "two")
    }
    assert len(captions) == 4
    assert set(ACTORS.regions) == set(_near(every))
