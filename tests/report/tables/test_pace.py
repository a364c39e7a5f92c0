"""Scores by speed: every window belongs to the pace that the vehicle really drove."""

from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import FRAME_NS, FakeRow, make_fake_run

from semgrid_eval.files import digest_value
from semgrid_eval.report.estimates.bootstrap import score_rows
from semgrid_eval.report.page.write import write_report
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.tables.pace import (
    PACES,
    mean_speed_mps,
    pace_frame,
    pace_tables,
    rows_without_pace,
    score_paces,
)
from semgrid_eval.scores.iou import class_iou
from semgrid_eval.scores.thumbnails import Drive, LogPictures, pictures_file, write_pictures

ROWS = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 2))
SPEEDS_MPS = (0.2, 2.0, 6.0, 12.0, 6.5)
STEP_S = FRAME_NS * 1e-9


def drive(speed_mps, *, frames=30):
    """A drive that begins at rest and has its speed from the tenth frame on, up and to the left."""
    way_m = np.maximum(np.arange(frames) - 10, 0) * STEP_S * speed_mps
    track = np.stack([0.6 * way_m, 0.8 * way_m, np.zeros(frames)], axis=1)
    return Drive(0, np.arange(frames) * FRAME_NS, track, np.zeros((3, 4)))


def made(folder, drives):
    run = make_fake_run(folder / "run", rows=ROWS, recordings=len(SPEEDS_MPS), windows=1)
    for i, known in enumerate(drives):
        write_pictures(pictures_file(run, digest_value(f"town_{i:03d}"), None), LogPictures(known))
    return load_runs([run])


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return made(tmp_path_factory.mktemp("paces"), [drive(speed) for speed in SPEEDS_MPS])


def scored(runs):
    return score_paces(runs, runs[0].rows, 0)


def test_speed_is_the_straight_way_over_the_time():
    assert mean_speed_mps(drive(5.0), 15 * FRAME_NS, 20 * FRAME_NS) == pytest.approx(5.0)
    assert mean_speed_mps(drive(5.0), 15 * FRAME_NS, int(16.5 * FRAME_NS)) == pytest.approx(5.0, rel=1e-6)
    assert mean_speed_mps(drive(5.0), 0, 20 * FRAME_NS) == pytest.approx(2.5)


def test_each_window_counts_at_its_own_pace(runs):
    paces = scored(runs)
    assert list(paces) == list(PACES)
    counts = runs[0].rows[0].results[0].counts.astype(np.int64)
    for name, at in zip(PACES, ([0], [1], [2, 4], [3]), strict=True):
        entry = paces[name]["BL-DC"]
        assert entry.row.windows == len(at)
        assert entry.mean["road"] == pytest.approx(class_iou(counts[at].sum(axis=0))[1])


def test_seeds_and_differences_are_those_of_the_same_windows(runs):
    table = pace_frame(scored(runs)).set_index(["pace", "row", "score"])
    line = table.loc[("4 to 8 m/s", "ED-DC", "static_known")]
    assert (line.reference, line.seeds, line.windows) == ("BL-DC", 2, 2)
    chosen = {
        window.recording for row in scored(runs)["4 to 8 m/s"].values() for window in row.row.results[0].record.windows
    }
    assert chosen == {"town_002", "town_004"}
    baseline = table.loc[("4 to 8 m/s", "BL-DC", "static_known")]
    assert line.difference == pytest.approx(line.iou - baseline.iou)
    whole = score_rows(runs[0].rows, np.random.default_rng(0))
    assert line.iou != pytest.approx(whole["ED-DC"].mean["static_known"])


def test_tables_have_a_column_for_each_pace_and_score(runs):
    tables = pace_tables(scored(runs))
    notes = [note for _, note in tables["paces"].columns]
    assert [note.partition(",")[0] for note in notes] == [name for name in PACES for _ in range(2)]
    assert len(tables["pace_differences"].bodies) == 1


@pytest.mark.parametrize("drives", [[], [drive(3.0, frames=0)] * 2], ids=["none kept", "no frame"])
def test_a_run_that_knows_no_drive_says_so(tmp_path, drives):
    runs = made(tmp_path, drives)
    assert scored(runs) == {}
    assert set(pace_tables({}).values()) == {None}
    page = write_report(tmp_path / "run")
    assert "No result here tells how fast its vehicle drove" in page.read_text()
    assert (page.parent / "paces.csv").read_text().count("\n") == 1


def test_a_log_whose_drive_is_unknown_is_left_out(tmp_path):
    paces = scored(made(tmp_path, [drive(6.0), drive(6.0)]))
    assert list(paces) == ["4 to 8 m/s"]
    assert paces["4 to 8 m/s"]["BL-DC"].row.windows == 2


def test_results_of_older_versions_do_not_hide_newer_ones(runs):
    (run,) = runs
    older = run.rows[0].results[0]
    untimed = tuple(window.model_copy(update={"input_stamps_ns": ()}) for window in older.record.windows)
    record = older.record.model_copy(
        update={"windows": untimed, "windows_id": run.rows[1].results[0].record.windows_id}
    )
    rows = [replace(run.rows[0], results=(replace(older, record=record),)), run.rows[1]]
    paces = score_paces(runs, rows, 0)
    assert [list(scores) for scores in paces.values()] == [["ED-DC"]] * len(PACES)
    assert rows_without_pace(rows, paces) == ["BL-DC"]


def test_a_run_with_pictures_shows_its_paces(seen_page):
    text = seen_page.read_text()
    assert 'id="table-paces"' in text
    assert "No result here tells how fast its vehicle drove" not in text
