"""What is kept is found, told from what is not ours, and removed only where nobody uses it."""

import os

import pytest
from support.small_runs import run, write_logs

from semgrid_eval.errors import InputError
from semgrid_eval.runs.caches import Kept, find_kept, remove, unused, uses_of

ROWS = [{"name": "BL-DC", "model": "newest"}]
NOW_S = 1_000_000.0


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Two runs on the same logs with one cache: `fine` has other cells than `usual`, and a row more."""
    folder = tmp_path_factory.mktemp("caches")
    logs = write_logs(folder / "logs")
    run(ROWS, logs, folder / "usual")
    finer = {"name": "fine", "model": "newest", "grid": {"stretch_frames": 9}}
    run([*ROWS, finer], logs, folder / "fine")
    return folder


def names(kept):
    return {each.path.name for each in kept}


def test_every_file_of_grids_that_a_run_uses_is_its_own_and_no_other(place):
    kept = find_kept(place / "grids")
    assert {each.kind for each in kept} == {"grids"}
    assert len(kept) == 4  # two logs that are scored, two configurations
    assert len(uses_of([place / "usual"]).grids & names(kept)) == 2
    assert uses_of([place / "usual", place / "fine"]).grids == names(kept)
    left = unused(kept, uses_of([place / "usual"]), None, NOW_S)
    assert names(left) == names(kept) - uses_of([place / "usual"]).grids


def test_what_a_cleaning_leaves_is_found_again_and_what_it_took_is_made_again(place, tmp_path):
    before = names(find_kept(place / "grids"))
    for each in unused(find_kept(place / "grids"), uses_of([place / "usual"]), None, NOW_S):
        remove(each)
    record = run(ROWS, place / "logs", place / "usual")
    assert record.rows[0].failure is None
    assert names(find_kept(place / "grids")) == uses_of([place / "usual"]).grids
    again = {"name": "fine", "model": "newest", "grid": {"stretch_frames": 9}}
    run([*ROWS, again], place / "logs", place / "more")
    assert names(find_kept(place / "grids")) == before


def test_answers_of_the_truth_are_kept_for_runs_on_logs_of_that_name(place, tmp_path):
    for name in ("toy2-truth-0123456789abcdef.npz", "other-truth-0123456789abcdef.npz"):
        (tmp_path / name).touch()
    kept = find_kept(tmp_path)
    assert {each.kind for each in kept} == {"truth"}
    assert names(unused(kept, uses_of([place / "usual"]), None, NOW_S)) == {"other-truth-0123456789abcdef.npz"}


@pytest.fixture
def towns(tmp_path):
    """A folder of logs with two towns, of which one is old, and things that only look like towns."""
    cache = tmp_path / "logs" / ".towns"
    for name in ("town-0000000000000001", "town-0000000000000002", "town-0000000000000003", "town-xyz"):
        (cache / name / "scene").mkdir(parents=True)
        (cache / name / "scene" / "soup.npy").write_bytes(b"12345")
    for number, used_s in ((1, NOW_S), (2, NOW_S - 10 * 86_400)):
        (cache / f"town-000000000000000{number}" / "town.json").write_text("{}")
        for file in (cache / f"town-000000000000000{number}").rglob("*.*"):
            os.utime(file, (used_s, NOW_S - 10 * 86_400))
    (cache / "link").symlink_to(cache / "town-0000000000000001")
    return tmp_path / "logs"


def test_towns_are_found_beside_logs_with_their_sizes_and_go_by_age_alone(towns, place):
    kept = find_kept(towns)
    assert [(each.kind, each.size_bytes) for each in kept] == [("town", 7), ("town", 7)]
    assert names(unused(kept, None, 5 * 86_400.0, NOW_S)) == {"town-0000000000000002"}
    assert unused(kept, uses_of([place / "usual"]), None, NOW_S) == []
    remove(kept[1])
    assert sorted(path.name[-1] for path in (towns / ".towns").glob("town-0*")) == ["1", "3"]


def test_with_runs_and_an_age_only_what_is_both_goes(place):
    (first, second, *_), uses = find_kept(place / "grids"), uses_of([place / "usual"])
    used = next(each for each in find_kept(place / "grids") if each in uses)
    old = [Kept(each.path, each.kind, 1, 0.0) for each in (first, second, used)]
    assert used not in unused(old, uses, 1.0, NOW_S)
    assert unused(old, uses, NOW_S + 1.0, NOW_S) == []
    assert len(unused(old, None, 1.0, NOW_S)) == 3


def test_a_folder_that_keeps_nothing_and_a_run_that_is_none_are_one_line(place, tmp_path):
    with pytest.raises(InputError, match="keeps neither grids nor towns"):
        find_kept(place / "usual")
    with pytest.raises(InputError, match="run"):
        uses_of([tmp_path])
