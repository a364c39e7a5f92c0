"""Scores by speed: every window belongs to the pace that the vehicle really drove."""

import numpy as np
import pytest
from support.fake_run import FRAME_NS, FakeRow, make_fake_run
from support.scoring import score_rows

from semgrid_eval.files import digest_value
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.report.estimates.bootstrap import Resampling, score_regions
from semgrid_eval.report.estimates.paces import PACES, mean_speed_mps, paces
from semgrid_eval.report.page.write import rows_without, write_report
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU, METRICS
from semgrid_eval.scores.thumbnails import LogPictures, Track, pictures_file, write_pictures

ROWS = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 2))
SPEEDS_MPS = (0.2, 2.0, 6.0, 12.0, 6.5)
STEP_S = FRAME_NS * 1e-9


def track(speed_mps, *, frames=30):
    """A drive that begins at rest and has its speed from the tenth frame on, up and to the left."""
    way_m = np.maximum(np.arange(frames) - 10, 0) * STEP_S * speed_mps
    poses = np.stack([0.6 * way_m, 0.8 * way_m, np.zeros(frames)], axis=1)
    return Track(0, np.arange(frames) * FRAME_NS, poses, np.zeros((3, 4)))


def made(folder, tracks):
    run = make_fake_run(folder / "run", rows=ROWS, recordings=len(SPEEDS_MPS), windows=1)
    for i, known in enumerate(tracks):
        write_pictures(pictures_file(run, digest_value(f"town_{i:03d}"), GridConfig()), LogPictures(known))
    return load_runs([run])


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return made(tmp_path_factory.mktemp("paces"), [track(speed) for speed in SPEEDS_MPS])


def scored(runs, metric=IOU):
    return score_regions(runs[0].rows, metric, paces(runs), Resampling(0))


def test_speed_is_the_straight_way_over_the_time():
    assert mean_speed_mps(track(5.0), 15 * FRAME_NS, 20 * FRAME_NS) == pytest.approx(5.0)
    assert mean_speed_mps(track(5.0), 15 * FRAME_NS, int(16.5 * FRAME_NS)) == pytest.approx(5.0, rel=1e-6)
    assert mean_speed_mps(track(5.0), 0, 20 * FRAME_NS) == pytest.approx(2.5)


def test_each_window_counts_at_its_own_pace(runs):
    found = scored(runs)
    assert list(found) == list(PACES)
    counts = runs[0].rows[0].results[0].counts.astype(np.int64)
    for name, at in zip(PACES, ([0], [1], [2, 4], [3]), strict=True):
        entry = found[name]["BL-DC"]
        assert entry.windows == len(at)
        assert entry.mean["road"] == pytest.approx(class_iou(counts[at].sum(axis=0))[1])


def test_differences_are_those_of_the_same_windows(runs):
    scores = scored(runs)["4 to 8 m/s"]
    mine, other = scores["ED-DC"], scores["BL-DC"]
    assert (len(mine.results), mine.windows) == (2, 2)
    difference = mine.minus(other, "static_known")
    assert difference.value == pytest.approx(mine.mean["static_known"] - other.mean["static_known"])
    whole = score_rows(runs[0].rows, np.random.default_rng(0))
    assert mine.mean["static_known"] != pytest.approx(whole["ED-DC"].mean["static_known"])


def test_every_metric_can_be_divided_by_pace(runs):
    whole = {name: score_regions(runs[0].rows, m, paces(runs), Resampling(0)) for name, m in METRICS.items()}
    totals = {name: sum(parts[pace]["ED-DC"].totals for pace in PACES) for name, parts in whole.items()}
    result = runs[0].rows[1].results[0]
    for name, total in totals.items():
        np.testing.assert_array_equal(total[0], result.read(name, "all").sum(axis=(0, 1)))


@pytest.mark.parametrize("tracks", [[], [track(3.0, frames=0)] * 2], ids=["none kept", "no frame"])
def test_a_run_that_knows_no_drive_says_so(tmp_path, tracks):
    runs = made(tmp_path, tracks)
    assert scored(runs) == {}
    page = write_report(tmp_path / "run")
    assert "No result here tells how fast its vehicle drove" in page.read_text()
    assert "paces" not in (page.parent / "summary.csv").read_text()


def test_a_log_whose_drive_is_unknown_is_left_out(tmp_path):
    runs = made(tmp_path, [track(6.0), track(6.0)])
    found = scored(runs)
    assert list(found) == ["4 to 8 m/s"]
    assert found["4 to 8 m/s"]["BL-DC"].windows == 2
    assert rows_without(found, runs[0].rows) == []
    assert rows_without({}, runs[0].rows) == ["BL-DC", "ED-DC"]


def test_a_run_with_pictures_shows_its_paces(seen_page):
    text = seen_page.read_text()
    assert 'id="table-paces"' in text
    assert "No result here tells how fast its vehicle drove" not in text
