from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run, with_counts
from support.scoring import score_rows

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES
from semgrid_eval.report.examples.choose import (
    MIN_CELLS,
    Contest,
    Pick,
    by_window,
    choose,
    choose_by_class,
    contests,
    mean_iou,
    rule_values,
)
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import headline

CAR, ROAD = CLASS_NAMES.index("car"), CLASS_NAMES.index("road")


def _rows(run):
    return {row.name: row for row in load_runs([run])[0].rows}


def _with_counts(row, counts):
    """Give a row's first result other counts, and as many windows, each of a recording of its own."""
    result = row.results[0]
    windows = tuple(
        result.record.windows[0].model_copy(update={"recording": f"r{i}", "target_frame": i})
        for i in range(len(counts))
    )
    return replace(row, results=(with_counts(result, counts, windows=windows),))


def _car(hits, cells=100):
    counts = np.zeros((CLASS_COUNT, CLASS_COUNT), int)
    counts[CAR, CAR], counts[CAR, ROAD] = hits, cells - hits
    return counts


def test_the_rule_is_the_smaller_of_both_leads(run):
    rows = _rows(run)
    model = _with_counts(rows["ED-DC"], [_car(80), _car(50), _car(60)])
    dc = _with_counts(rows["BL-DC"], [_car(30), _car(70), _car(20)])
    nt = _with_counts(rows["BL-NT"], [_car(60), _car(10), _car(10)])
    contest = Contest(model, (dc, nt))
    assert rule_values(contest)[:, CAR] == pytest.approx([0.2, -0.2, 0.4])
    assert [pick.index for pick in choose(contest, best=2, worst=1)] == [2, 0, 1]
    by_class = {pick.reason: pick.index for pick in choose_by_class(contest)}
    assert by_class == {"Car, largest": 2, "Car, smallest": 1}


def test_a_class_with_few_cells_does_not_count(run):
    rows = _rows(run)
    model = _with_counts(rows["ED-DC"], [_car(MIN_CELLS - 1, MIN_CELLS - 1), _car(MIN_CELLS, MIN_CELLS)])
    values = rule_values(Contest(model, ()))
    assert np.isnan(values[0, CAR])
    assert values[1, CAR] == 1.0


def test_windows_are_compared_by_target_frame_whatever_their_order(run):
    rows = _rows(run)
    rival = rows["BL-DC"]
    result = rival.results[0]
    flipped = with_counts(result, result.counts[::-1], windows=result.record.windows[::-1])
    straight = rule_values(Contest(rows["ED-DC"], (rival,)))
    turned = rule_values(Contest(rows["ED-DC"], (replace(rival, results=(flipped,)),)))
    np.testing.assert_array_equal(straight, turned)


def test_examples_are_of_different_recordings(run):
    rows = _rows(run)
    contest = Contest(rows["ED-DC"], (rows["BL-DC"], rows["BL-NT"]))
    picks = choose(contest, best=3, worst=3)
    recordings = [contest.result.record.windows[pick.index].recording for pick in picks]
    assert len(set(recordings[:3])) == len(set(recordings[3:])) == 3
    scores = [pick.score for pick in picks]
    assert scores[:3] == sorted(scores[:3], reverse=True)
    assert scores[3:] == sorted(scores[3:])


def test_the_papers_contest_comes_first_and_others_follow(run):
    rows = list(_rows(run).values())
    found = headline(score_rows(rows, np.random.default_rng(0), draws=2))
    got = contests([row for row in rows if row.windows], found)
    assert [(c.model.name, [r.name for r in c.rivals]) for c in got] == [
        ("ED-DC", ["BL-DC", "BL-NT"]),
        ("ED-Sp2", ["BL-Sp2"]),
    ]


def test_a_row_named_like_a_baseline_that_is_none_is_measured_against_one(tmp_path):
    kinds = (FakeRow("plain", "x", baseline=True), FakeRow("mine", "BL", 0.1, 1, baseline=False))
    loaded = load_runs([make_fake_run(tmp_path / "run", rows=kinds, recordings=2)])[0].rows
    (found,) = contests(loaded, headline(score_rows(loaded, np.random.default_rng(0), draws=2)))
    assert (found.model.name, [row.name for row in found.rivals]) == ("BL-mine", ["x-plain"])


def test_only_the_baselines_own_twin_on_inputs_that_are_not_moved_is_a_rival(tmp_path):
    kinds = (
        FakeRow("DC", "ED", 0.1, 1),
        FakeRow("NT", "ED", 0.1, 1, translate=False),
        FakeRow("Fuse", "BL"),
        FakeRow("NT", "BL", translate=False),  # of another baseline
    )
    loaded = load_runs([make_fake_run(tmp_path / "run", rows=kinds, recordings=2)])[0].rows
    first = contests(loaded, headline(score_rows(loaded, np.random.default_rng(0), draws=2)))[0]
    assert (first.model.name, [row.name for row in first.rivals]) == ("ED-DC", ["BL-Fuse"])


def test_where_nothing_is_scored_there_is_no_contest(run):
    assert contests(list(_rows(run).values()), None) == []


def test_longer_horizons_are_shown_in_a_row(tmp_path):
    kinds = (FakeRow("DC", "BL"), *(FakeRow(f"PH{k}", "ED", 0.1, 1, horizon_steps=k + 1) for k in (2, 1)))
    kinds = (*kinds, FakeRow("PH1", "BL", horizon_steps=2))
    run = make_fake_run(tmp_path / "run", rows=(FakeRow("DC", "ED", 0.1, 1), *kinds), recordings=2)
    loaded = load_runs([run])[0].rows
    got = contests(loaded, headline(score_rows(loaded, np.random.default_rng(0), draws=2)))
    assert [(c.model.name, [r.name for r in c.rivals]) for c in got] == [
        ("ED-DC", ["BL-DC"]),
        ("ED-DC", ["ED-PH1", "ED-PH2"]),
        ("ED-PH1", ["BL-PH1"]),
    ]
    assert [None if row is None else row.name for row in got[1].baselines] == ["BL-DC", "BL-PH1", None]


def test_another_model_at_a_longer_horizon_is_not_shown_in_the_row(seen, tmp_path):
    rows = [row for row in load_runs([seen])[0].rows if row.record.name in ("BL-DC", "own-DC", "own-PH1")]
    found = headline(score_rows(rows, np.random.default_rng(0), draws=2))
    assert [contest.baselines != () for contest in contests(rows, found)] == [False, True]
    untranslated = rows[2].results[0].record.config | {"translate": False}
    result = replace(rows[2].results[0], record=rows[2].results[0].record.model_copy(update={"config": untranslated}))
    changed = [*rows[:2], replace(rows[2], results=(result,))]
    assert not any(contest.baselines for contest in contests(changed, found))


@pytest.mark.parametrize(
    ("rows", "model", "rivals"),
    [
        ((FakeRow("DC", "BL"),), "BL-DC", []),
        ((FakeRow("DC", "BL"), FakeRow("Fuse", "BL")), "BL-Fuse", ["BL-DC"]),
        ((FakeRow("Sp2", "ED", 0.1, 1), FakeRow("Sp2", "BL")), "ED-Sp2", ["BL-Sp2"]),
    ],
)
def test_other_runs_get_a_sensible_contest(tmp_path, rows, model, rivals):
    loaded = load_runs([make_fake_run(tmp_path / "run", rows=rows, recordings=3)])[0].rows
    first = contests(loaded, headline(score_rows(loaded, np.random.default_rng(0), draws=2)))[0]
    assert (first.model.name, [rival.name for rival in first.rivals]) == (model, rivals)


def test_a_window_that_is_picked_twice_is_shown_once():
    picks = [Pick(4, "Car, largest", 0.1), Pick(2, "Car, smallest", -0.1), Pick(4, "Road, largest", 0.2)]
    assert by_window(picks) == [(picks[0], picks[2]), (picks[1],)]


def test_the_iou_of_a_window_is_the_mean_over_known_classes_with_enough_cells(run):
    row = _with_counts(_rows(run)["ED-DC"], [_car(80), _car(MIN_CELLS - 1, MIN_CELLS - 1)])
    result = row.shown
    counts = result.counts.copy()
    counts[0, ROAD, ROAD], counts[0, 0, 0] = 60, 1000
    result = with_counts(result, counts)
    first, second = result.record.windows
    assert mean_iou(result, first) == pytest.approx((80 / 100 + 60 / 80) / 2)  # 20 cells of car were taken for road
    assert np.isnan(mean_iou(result, second))
    assert np.isnan(mean_iou(result, first.model_copy(update={"recording": "another"})))
