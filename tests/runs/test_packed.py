"""Packed grids take the place of logs: the same run gives the same numbers without them."""

import shutil

import pytest
import torch
from support.small_runs import run, write_logs

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.progress import silent_stage
from semgrid_eval.runs.data import RunData
from semgrid_eval.runs.matrix import load_matrix
from semgrid_eval.runs.packed import INDEX_FILE, pack_grids
from semgrid_eval.scores import results

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


def test_a_run_on_packed_grids_is_the_run_on_logs(folders, tmp_path):
    logs, packed = folders
    from_logs, from_grids = run(ROWS, logs, tmp_path / "a"), run(ROWS, packed, tmp_path / "b")
    assert from_grids.logs == from_logs.logs
    assert from_grids.rows == from_logs.rows
    for row in from_grids.rows:
        first, second = (
            results.read_sums(results.result_folder(tmp_path / out, row.results[0]), "iou", "all") for out in "ab"
        )
        assert (first == second).all()


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
    (packed / INDEX_FILE).write_text('{"grid": {}}')
    with pytest.raises(InputError, match=r"packed\.json: logs"):
        run(rows, packed, tmp_path / "c")
