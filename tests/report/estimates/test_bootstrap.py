from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import counted_row, make_fake_run, reader
from support.scoring import score_rows

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.report.estimates.bootstrap import Resampling, RowScores, comparable, recording_weights, score_regions
from semgrid_eval.report.estimates.division import EVERYWHERE, of_cells
from semgrid_eval.report.estimates.intervals import LEVEL, Estimate
from semgrid_eval.report.estimates.student import stretch
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import verdict
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU, METRICS
from semgrid_eval.scores.regions.actors import ACTORS


def figures(counts):
    return IOU.figures(IOU.ratios(counts))


def drives_of(result):
    return [window.drive for window in result.record.windows]


def test_a_resample_scores_like_the_recordings_copied_out(run):
    """The draws agree with a twin that copies whole recordings and pools their counts."""
    row = load_runs([run])[0].rows[0]
    got = score_rows([row], np.random.default_rng(3), draws=5)[row.name]
    (result,) = row.results
    names = sorted(set(drives_of(result)))
    for weights, draw in zip(recording_weights(len(names), np.random.default_rng(3), draws=5), got.draws, strict=True):
        times = dict(zip(names, weights, strict=True))
        copies = [c for c, drive in zip(result.counts, drives_of(result), strict=True) for _ in range(times[drive])]
        np.testing.assert_allclose(draw, figures(np.sum(copies, axis=0, dtype=np.int64)))


def test_seeds_are_resampled_like_those_copied_out(run):
    row = next(row for row in load_runs([run])[0].rows if len(row.results) == 3)
    got = score_rows([row], 4, draws=6)[row.name]
    generator = np.random.default_rng(4)
    names = sorted(set(drives_of(row.results[0])))
    weights = recording_weights(len(names), generator, draws=6)
    picks = generator.multinomial(3, np.full(3, 1 / 3), size=6)
    for times, seeds, draw in zip(weights, picks, got.draws, strict=True):
        copied = dict(zip(names, times, strict=True))
        values = []
        for result, taken in zip(row.results, seeds, strict=True):
            pairs = zip(result.counts, drives_of(result), strict=True)
            total = sum((count.astype(np.int64) * copied[drive] for count, drive in pairs), np.zeros((10, 10), int))
            values += [figures(total)] * taken
        present = np.isfinite(values).any(axis=0)
        np.testing.assert_allclose(draw[present], np.nanmean(np.array(values)[:, present], axis=0))


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
def test_every_metric_is_resampled_alike(run, metric):
    row = next(row for row in load_runs([run])[0].rows if len(row.results) == 3)
    scores = score_regions([row], metric, EVERYWHERE, Resampling(3, draws=4))["all"][row.name]
    generator = np.random.default_rng(3)
    weights = Resampling(generator, draws=4).draw(sorted(set(drives_of(row.results[0]))), [3]).weights
    names, owner = row.results[0].recordings
    for at, times in enumerate(weights):
        sums = [(result.read(metric.name, "all")[:, 0].T * times[owner]).T.sum(axis=0) for result in row.results]
        by_seed = np.array([metric.figures(metric.ratios(np.asarray(total, np.int64))) for total in sums])
        low, high = np.nanmin(by_seed, axis=0), np.nanmax(by_seed, axis=0)
        assert ((scores.draws[at] >= low - 1e-12) & (scores.draws[at] <= high + 1e-12)).all()
    assert len(names) == 8


def test_rows_of_other_targets_are_never_subtracted(run):
    row = load_runs([run])[0].rows[0]
    other = replace(row, name="other", results=(_with_targets(row.results[0], "other"),))
    scores = score_rows([row, other], 0, draws=3)
    with pytest.raises(ValueError, match="BL-DC and other are scored on other targets"):
        scores[row.name].minus(scores["other"], "road")
    assert not comparable(row, other)


def _with_targets(result, targets):
    return replace(result, record=result.record.model_copy(update={"targets": targets}))


def test_only_what_is_in_a_region_is_evidence_for_it(run):
    rows = [row for row in load_runs([run])[0].rows if row.windows]
    found = score_regions(rows, IOU, of_cells(ACTORS), Resampling(0, draws=3))
    for at, region in enumerate(("moving", "standing")):
        for row in rows:
            counts = row.results[0].read("iou", "actors")[:, at]
            assert found[region][row.name].windows == (counts.sum(axis=(1, 2)) > 0).sum()
            assert found[region][row.name].cells["mean_known"] == counts[:, 1:].sum()


def test_windows_without_such_actors_are_no_evidence():
    hits = {"car": [10, 90, 0, 0]}
    row = counted_row("BL-DC", {"car": [50] * 4}, near={"moving": hits, "standing": hits})
    sums = row.results[0].read("iou", "actors").copy()
    sums[2:] = 0
    row = replace(row, results=(replace(row.results[0], read=reader({("iou", "actors"): sums})),))
    entry = score_regions([row], IOU, of_cells(ACTORS), Resampling(0))["moving"]["BL-DC"]
    assert entry.windows == 2
    assert entry.mean["car"] == pytest.approx(0.5)
    twin = Resampling(0).draw(["town_0", "town_1"], [1])  # the others are not drawn
    np.testing.assert_allclose(entry.draws[:, list(IOU.labels).index("car")], twin.weights @ [0.05, 0.45])


def test_without_truth_there_is_no_region():
    row = counted_row("BL-DC", {"car": [50]})
    assert score_regions([row], IOU, of_cells(ACTORS), Resampling(0)) == {}


def test_groups_are_those_that_the_logs_name(run):
    row = load_runs([run])[0].rows[0]
    logs = sorted({window.log for window in row.results[0].record.windows})
    paired = replace(row, groups={log: f"town {i // 2}" for i, log in enumerate(logs)})
    alone, together = (
        score_regions([each], IOU, EVERYWHERE, Resampling(1, level="groups"))["all"][row.name] for each in (row, paired)
    )
    names = row.results[0].recordings[0].tolist()
    weights = Resampling(1, level="groups").draw([f"town {i // 2}" for i in range(len(names))], [1]).weights
    pooled = np.stack([row.results[0].counts[row.results[0].recordings[1] == i].sum(axis=0) for i in range(len(names))])
    np.testing.assert_allclose(together.draws, figures(np.tensordot(weights, pooled.astype(np.int64), 1)))
    assert (alone.draws != together.draws).any()


def test_value_is_the_mean_over_seeds_of_pooled_scores(run):
    row = next(row for row in load_runs([run])[0].rows if len(row.results) == 3)
    got = score_rows([row], np.random.default_rng(0), draws=10)[row.name]
    cars = [class_iou(result.counts.sum(axis=0))[CLASS_NAMES.index("car")] for result in row.results]
    assert got.mean["car"] == pytest.approx(np.mean(cars))
    assert got.by_seed[:, list(IOU.labels).index("car")] == pytest.approx(cars)


def test_a_row_does_not_differ_from_itself(run):
    rows = load_runs([run])[0].rows[:1]
    entry = score_rows(rows, np.random.default_rng(0))[rows[0].name]
    assert entry.minus(entry, "road") == Estimate(0.0, 0.0, 0.0)
    assert verdict(entry.minus(entry, "road")) == "open"


def test_rows_that_share_their_trainings_do_not_differ(run):
    row = next(row for row in load_runs([run])[0].rows if len(row.results) == 3)
    twin = replace(row, name="twin")
    scores = score_rows([row, twin], np.random.default_rng(0))
    assert scores["twin"].minus(scores[row.name], "road") == Estimate(0.0, 0.0, 0.0)


def test_stretches_of_one_log_are_resampled_together(run):
    row = load_runs([run])[0].rows[0]
    one = replace(row, results=tuple(map(_as_stretches, row.results)))
    entry = score_rows([one], np.random.default_rng(0))[row.name]
    assert np.isnan(entry.estimate("road").low)  # one log gives no interval, however many stretches it was cut into


def _as_stretches(result):
    windows = tuple(
        window.model_copy(update={"recording": f"drive#{number}"})
        for number, window in enumerate(result.record.windows)
    )
    return replace(result, record=result.record.model_copy(update={"windows": windows}))


def test_pairing_makes_differences_surer_than_the_rows_alone(run):
    rows = load_runs([run])[0].rows
    scores = score_rows(rows, np.random.default_rng(0))
    first, second = scores["BL-DC"], scores["BL-Fuse"]
    difference = first.minus(second, "static")
    widths = [e.high - e.low for e in (first.estimate("static"), second.estimate("static"))]
    assert difference.high - difference.low < sum(widths)
    assert difference.low <= difference.value <= difference.high


def test_one_recording_gives_no_interval(tmp_path):
    rows = load_runs([make_fake_run(tmp_path / "run", recordings=1)])[0].rows
    entry = score_rows(rows, np.random.default_rng(0))["BL-DC"]
    assert np.isnan(entry.estimate("road").low)
    assert verdict(entry.estimate("road")) == "open"


def test_an_interval_is_the_middle_of_the_draws_longer_by_what_few_recordings_ask(run):
    row = load_runs([run])[0].rows[0]
    draws, size = np.full((1001, len(IOU.labels)), np.nan), len(IOU.labels)
    draws[:, list(IOU.labels).index("road")] = np.linspace(0.4, 0.6, 1001)
    sums, units = np.zeros((1, 10, 10), np.int64), np.full(size, 5)
    entry = RowScores(row, IOU, row.results, np.full((1, size), 0.5), draws, sums, 1, units)
    half = 0.095 * stretch(5, LEVEL)
    assert entry.estimate("road") == Estimate(0.5, pytest.approx(0.5 - half), pytest.approx(0.5 + half))
    assert np.isnan(entry.estimate("car").low)
