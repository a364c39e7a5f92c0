"""Packed grids take the place of logs: the same run gives the same numbers without them."""

import shutil

import pytest
import torch
from support.drawn_again import write_town_like
from support.small_runs import run, write_logs

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.grids.recording import find_recordings, write_recordings
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.packed import INDEX_FILE, PackedGrids, pack_grids
from semgrid_eval.scores import results
from semgrid_eval.scores.sums import read_sums
from semgrid_eval.windows.storage import Storage

SPLIT = ["split2_upper", "split2_lower"]
ROWS = [
    {"name": "BL-Sp2", "model": "overlay", "sensors": SPLIT},
    {"name": "ED-DC", "model": "ed"},
]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Logs, and their packed grids."""
    folder = tmp_path_factory.mktemp("packed")
    logs = write_logs(folder / "logs")
    rows = [row for row in load_matrix("paper").rows if row.name in ("BL-Sp2", "ED-DC")]
    cpu = torch.device("cpu")
    data = RunData(logs, folder / "grids", rows, executor=InProcess(), device=cpu, stage=silent_stage)
    pack_grids(data, GridConfig(), folder / "packed")
    return logs, folder / "packed"


@pytest.mark.slow
def test_a_run_on_packed_grids_is_the_run_on_logs(folders, tmp_path):
    logs, packed = folders
    from_logs, from_grids = run(ROWS, logs, tmp_path / "a"), run(ROWS, packed, tmp_path / "b")
    assert from_grids.logs == from_logs.logs
    assert from_grids.rows == from_logs.rows
    for row in from_grids.rows:
        first, second = (read_sums(results.result_folder(tmp_path / out, row.results[0]), "iou", "all") for out in "ab")
        assert (first == second).all()


@pytest.mark.slow
def test_processes_read_packed_grids(folders, tmp_path):
    record = run([ROWS[0], {"name": "BL-DC", "model": "newest"}], folders[1], tmp_path / "run", Processes(2))
    assert [row.failure for row in record.rows] == [None, None]


def test_grids_made_in_another_way_are_refused(folders, tmp_path):
    rows = [{"name": "BL", "model": "newest", "grid": {"morphology": "off"}}]
    record = run(rows, folders[1], tmp_path / "run")
    assert record.rows[0].failure == f"{folders[1]}: holds grids that were made in another way than this row's"


def test_what_is_missing_is_named(folders, tmp_path):
    packed = shutil.copytree(folders[1], tmp_path / "packed")
    rows = [{"name": "BL", "model": "newest", "validation_split": "test"}]
    assert "holds no recording of split 'test'" in run(rows, packed, tmp_path / "a").rows[0].failure
    (packed / "val" / "toy2.npz").unlink()
    assert "toy2.npz" in run([{"name": "BL", "model": "newest"}], packed, tmp_path / "b").rows[0].failure
    index = (packed / INDEX_FILE).read_text()
    (packed / INDEX_FILE).write_text(index.replace("val", "train"))
    with pytest.raises(InputError, match=r"packed\.json: is damaged"):
        run(rows, packed, tmp_path / "c")


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """Packed grids of logs with all sorts of names, which tell the truth."""
    folder = tmp_path_factory.mktemp("named")
    logs, rows = write_town_like(folder / "logs"), [row for row in load_matrix("paper").rows if row.name == "ED-DC"]
    for path, name in {"train/toy0": "b-1", "train/toy1": "\u00fc", "val/toy2": "my toy2", "val/toy3": "a-1"}.items():
        (logs / f"{path}.mcap").rename(logs / path.partition("/")[0] / f"{name}.mcap")
    cpu = torch.device("cpu")
    data = RunData(logs, folder / "grids", rows, executor=InProcess(), device=cpu, stage=silent_stage)
    pack_grids(data, GridConfig(), folder / "packed")
    return folder / "packed"


def test_logs_may_have_any_name(named, tmp_path):
    record = run([ROWS[1]], named, tmp_path / "run")
    assert [row.failure for row in record.rows] == [None]
    assert {log.name for log in record.logs} == {"b-1", "\u00fc", "my toy2", "a-1"}


def test_grids_of_another_log_are_refused(named, tmp_path):
    packed = shutil.copytree(named, tmp_path / "packed")
    shutil.copyfile(packed / "train" / "b-1.npz", packed / "val" / "a-1.npz")
    (row,) = run([{"name": "BL", "model": "newest"}], packed, tmp_path / "run").rows
    assert "a-1.npz: belongs to another id" in row.failure


def test_grids_whose_recordings_are_of_another_log_than_their_seal_says_are_refused(named, tmp_path):
    packed = shutil.copytree(named, tmp_path / "packed")
    one, other = (
        next(
            log.digest
            for log in PackedGrids(packed, [], Storage(torch.device("cpu"))).records.values()
            if log.name == name
        )
        for name in ("a-1", "b-1")
    )
    recordings = find_recordings(packed / "train" / "b-1.npz", packed, owner=other)
    write_recordings(packed / "val" / "a-1.npz", recordings, owner=one)
    (row,) = run([{"name": "BL", "model": "newest"}], packed, tmp_path / "run").rows
    assert row.failure.endswith(f"a-1.npz: holds the log {other}, not {one}")


def test_packed_grids_do_not_hold_the_truth_and_need_no_logs(named, tmp_path, caplog):
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "top", "model": "ceiling", "settings": {"draws": 5}}]
    scored, asking = run(rows, named, tmp_path / "run", second_target="expected").rows
    assert scored.failure is None
    folder = results.result_folder(tmp_path / "run", scored.results[0])
    assert results.is_done(folder)
    assert not results.read_result(folder).has_expected
    assert asking.failure is None
    assert asking.skipped == "packed grids do not hold the truth, only their logs do"
    assert not caplog.messages, "nobody looks for pictures where there are no logs"
    assert not (tmp_path / "run" / "pictures").exists()
