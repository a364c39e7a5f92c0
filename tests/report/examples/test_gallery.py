import shutil
from dataclasses import replace

import numpy as np
import pytest
from support.fake_run import FakeRow, make_fake_run
from support.scoring import score_rows

from semgrid_eval.grids.spec import GridConfig, GridSpec
from semgrid_eval.report.examples import gallery as gallery_module
from semgrid_eval.report.examples.choose import Contest, choose
from semgrid_eval.report.examples.gallery import example_groups, gaps, groups_of, widths
from semgrid_eval.report.examples.thumbnails import RunThumbnails
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.report.rows.pairing import headline
from semgrid_eval.scores.results import read_windows


def gallery(run):
    runs = load_runs([run])
    scored = [row for row in runs[0].rows if row.windows]
    return scored, example_groups(runs, scored, headline(score_rows(scored, np.random.default_rng(0), draws=2)))


def test_contests_horizons_and_sensors_are_shown_and_explained(seen):
    rows, groups = gallery(seen)
    assert [group.title for group in groups] == [
        "own-DC against BL-DC",
        "own-DC against BL-DC, more windows",
        "own-DC against BL-DC, class by class",
        "Looking further ahead: own-DC, own-PH1, own-PH2",
        "own-PH1 against BL-PH1",
        "own-Sp2 against BL-Sp2",
    ]
    assert all(group.problem == "" and group.windows for group in groups)
    assert [group.shown for group in groups] == [True, False, False, False, False, False]
    assert groups[3].hint.startswith("Each column asks the same model")
    assert "Hatched is the ground" in groups[5].hint
    assert gaps(rows, groups) == []


def test_windows_are_read_once_for_contests_that_share_them(run, monkeypatch):
    read = []
    monkeypatch.setattr(gallery_module, "read_windows", lambda *args: read.append(args) or read_windows(*args))
    _, groups = gallery(run)
    assert [group.title for group in groups][3:] == ["ED-Sp2 against BL-Sp2"]
    assert len(read) == len(set(read)) == 2


def test_a_window_of_several_classes_is_shown_once(seen):
    _, groups = gallery(seen)
    recordings = [window.window.recording for window in groups[2].windows]
    assert sorted(recordings) == ["toy0", "toy1"]


def test_what_a_run_cannot_show_is_said(tmp_path):
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 1))
    loaded, groups = gallery(make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1))
    said = " ".join(gaps(loaded, groups))
    for words in ("no example with a blind band", "no example of them in a row", "no pictures of what sensors saw"):
        assert words in said
    assert gaps(loaded, []) == []


def test_grids_are_as_wide_as_their_rows_tell(run):
    row = load_runs([run])[0].rows[0]
    grid = GridConfig(spec=GridSpec(cell_m=0.5, columns=100)).model_dump(mode="json")
    record = row.shown.record.model_copy(update={"config": {"grid": grid}})
    narrow = replace(row, results=(replace(row.shown, record=record),))
    assert widths([row, row]) == "100 m"
    assert widths([row, narrow]) == "50 m or 100 m"


def test_several_horizons_of_baselines_alone_are_no_example(tmp_path):
    rows = (FakeRow("DC", "BL"), FakeRow("DC", "ED", 0.1, 1), FakeRow("PH1", "BL", horizon_steps=2))
    said = gaps(*gallery(make_fake_run(tmp_path / "run", rows=rows, recordings=2, windows=1)))
    assert "no example of them in a row" in said[1]


def test_a_run_without_pictures_shows_the_same_windows(seen, tmp_path):
    shutil.copytree(seen, tmp_path / "run", ignore=shutil.ignore_patterns("pictures", "grids"))
    rows, groups = gallery(tmp_path / "run")
    _, full = gallery(seen)
    assert [[w.title for w in group.windows] for group in groups] == [
        [w.title for w in group.windows] for group in full
    ]
    shown = [p for group in groups for w in group.windows for column in w.film for p in column.pictures]
    assert {picture.kind for picture in shown} == {"grid"}
    assert groups[5].hint == "Each input is seen by several sensors."
    assert len(gaps(rows, groups)) == 1


def test_damaged_pictures_are_left_out(seen, tmp_path):
    shutil.copytree(seen, tmp_path / "run", ignore=shutil.ignore_patterns("grids"))
    for path in (tmp_path / "run" / "pictures").iterdir():
        path.write_bytes(path.read_bytes()[:-40])
    rows, groups = gallery(tmp_path / "run")
    assert all(group.problem == "" for group in groups)
    assert "There are no pictures of what sensors saw" in gaps(rows, groups)[0]


@pytest.mark.parametrize("lost", ["predictions.npz", "windows"])
def test_lost_arrays_are_told_not_raised(tmp_path, lost):
    (run,) = load_runs([make_fake_run(tmp_path / "run", recordings=2, windows=1)])
    rows = {row.name: row for row in run.rows}
    contest = Contest(rows["ED-DC"], (rows["BL-DC"],))
    if lost == "windows":
        shutil.rmtree(run.folder / "windows")
    for result in rows["ED-DC"].results if lost == "predictions.npz" else ():
        (result.folder / lost).unlink()
    (group,) = groups_of(contest, {"": choose(contest, best=1, worst=1)}, RunThumbnails(run))
    assert group.windows == ()
    assert (lost if lost == "predictions.npz" else contest.result.record.windows_id) in group.problem
