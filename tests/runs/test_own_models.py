"""Models of one's own in a run: scored as any other, kept, and told apart by all that their numbers depend on."""

import importlib.metadata

import pytest
from support.small_runs import result_of, run

from semgrid_eval.executors import Processes
from semgrid_eval.models.registry import ENTRY_POINT_GROUP
from semgrid_eval.scores import results
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.sums import read_sums

pytestmark = pytest.mark.usefixtures("own_models_here")


def score(out, record, name):
    row = next(row for row in record.rows if row.name == name)
    result_of(out, row)
    counts = read_sums(results.result_folder(out, row.results[0]), "iou", "all")[:, 0]
    return float(IOU.means(class_iou(counts.sum(axis=0)))["mean_known"])


PREDICTOR = """
from pathlib import Path
from semgrid_eval.models.model import Model, one_hot

class Mine(Model):
    files = FILES

    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.known = int(Path(__file__).with_name("weights.txt").read_text())

    def predict(self, batch):
        return one_hot(batch.past[:, 0, -1] * self.known)
"""


@pytest.mark.parametrize(("files", "kept"), [('("weights.txt",)', True), ("None", False)])
def test_a_predictor_that_declares_its_weights_is_kept_and_another_is_scored_again(logs, tmp_path, files, kept):
    (tmp_path / "mine.py").write_text(PREDICTOR.replace("FILES", files))
    rows, out = [{"name": "mine", "model": f"{tmp_path}/mine.py:Mine"}], tmp_path / "run"
    found = []
    for weights in ("1", "1", "0"):
        (tmp_path / "weights.txt").write_text(weights)
        (row,) = run(rows, logs, out).rows
        file = results.result_folder(out, row.results[0]) / "sums.npz"
        found.append((row.results[0], file.stat().st_mtime_ns))
    assert (found[1] == found[0]) is kept
    assert found[1][0] == found[0][0]
    assert (found[2][0] != found[1][0]) is kept  # what is not declared is not known, and replaces what was there
    assert not run(rows, logs, out, only=("mine",)).rows[0].failure


def test_a_declared_file_that_is_missing_fails_its_row_alone(logs, tmp_path):
    (tmp_path / "mine.py").write_text(PREDICTOR.replace("FILES", '("weights.bin",)'))
    rows = [{"name": "mine", "model": f"{tmp_path}/mine.py:Mine"}, {"name": "BL-DC", "model": "newest"}]
    record = run(rows, logs, tmp_path / "run")
    assert "mine.py:Mine: files: declares the file weights.bin, which is not in" in str(record.rows[0].failure)
    assert record.rows[1].failure is None


CHANCE = """
import torch
from semgrid_eval.models.model import Model, one_hot

class Chance(Model):
    random = True
    files = ()

    def predict(self, batch):
        return one_hot(torch.randint(0, 10, batch.target.shape, dtype=torch.uint8))
"""


def test_a_model_that_declares_chance_is_repeated_with_seeds_and_each_gives_the_same_again(logs, tmp_path):
    (tmp_path / "chance.py").write_text(CHANCE)
    rows = [{"name": "own", "model": f"{tmp_path}/chance.py:Chance", "repeats": 2}]
    counts = []
    for name in ("one", "two"):
        (row,) = run(rows, logs, tmp_path / name).rows
        assert [results.read_result(results.result_folder(tmp_path / name, i)).seed for i in row.results] == [5, 6]
        counts.append(
            [read_sums(results.result_folder(tmp_path / name, i), "iou", "all")[:, 0][0].tolist() for i in row.results]
        )
    assert counts[0] == counts[1]
    assert counts[0][0] != counts[0][1]


GREEDY = """
import torch
from pathlib import Path
from semgrid_eval.models.model import Model, one_hot

class Greedy(Model):
    def predict(self, batch):
        seen = Path(__file__).with_name("seen")
        if not seen.exists():
            seen.touch()
            raise torch.OutOfMemoryError("CUDA out of memory.\\nTried to allocate")
        return one_hot(batch.past[:, 0, -1])
"""


@pytest.mark.slow
def test_an_own_model_without_room_is_tried_again_alone(logs, tmp_path):
    (tmp_path / "greedy.py").write_text(GREEDY)
    rows = [{"name": "own", "model": f"{tmp_path}/greedy.py:Greedy"}, {"name": "BL-DC", "model": "newest"}]
    record = run(rows, logs, tmp_path / "run", Processes(2, threads=1))
    assert [row.failure for row in record.rows] == [None, None]
    assert score(tmp_path / "run", record, "own") == score(tmp_path / "run", record, "BL-DC")
    (tmp_path / "seen").unlink()
    record = run(rows, logs, tmp_path / "again")
    assert record.rows[0].failure == "out of memory: CUDA out of memory."


def test_a_model_of_ones_own_is_scored_like_any_other(logs, tmp_path):
    (tmp_path / "mine.py").write_text(
        "from semgrid_eval.models.model import Model, one_hot\n"
        "class Newest(Model):\n"
        "    def predict(self, batch):\n"
        "        return one_hot(batch.past[:, 0, -1])\n"
    )
    rows = [{"name": "mine", "model": f"{tmp_path}/mine.py:Newest"}, {"name": "BL-DC", "model": "newest"}]
    record = run(rows, logs, tmp_path / "run")
    assert score(tmp_path / "run", record, "mine") == score(tmp_path / "run", record, "BL-DC")


def test_an_installed_model_is_scored_and_its_package_is_part_of_the_record(logs, tmp_path, monkeypatch):
    value = "semgrid_eval.models.newest:RepeatNewest"
    found = [importlib.metadata.EntryPoint(name, value, ENTRY_POINT_GROUP) for name in ("mine", "newest")]
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda *, group: importlib.metadata.EntryPoints(found).select(group=group)
    )
    record = run([{"name": "mine", "model": "mine"}, {"name": "BL-DC", "model": "newest"}], logs, tmp_path / "run")
    assert score(tmp_path / "run", record, "mine") == score(tmp_path / "run", record, "BL-DC")
    configs = [
        results.read_result(results.result_folder(tmp_path / "run", row.results[0])).config for row in record.rows
    ]
    assert configs[0]["code"] != configs[1]["code"]


def test_a_model_that_cheats_or_leaves_is_stopped(logs, tmp_path):
    (tmp_path / "bad.py").write_text(
        "import torch\n"
        "from semgrid_eval.models.model import Model\n"
        "class Peeks(Model):\n"
        "    def predict(self, batch):\n"
        "        batch.mask.fill_(True)\n"
        "        return torch.nn.functional.one_hot(batch.target.long(), 10).permute(0, 3, 1, 2).float()\n"
        "class Leaves(Model):\n"
        "    def predict(self, batch):\n"
        "        raise SystemExit(3)\n"
        "class Ends(Model):\n"
        "    def fit(self, windows):\n"
        "        raise BaseException('of no kind')\n"
    )
    rows = [{"name": name, "model": f"{tmp_path}/bad.py:{name}"} for name in ("Peeks", "Leaves", "Ends")]
    record = run(rows, logs, tmp_path / "run")
    counts = read_sums(results.result_folder(tmp_path / "run", record.rows[0].results[0]), "iou", "all")[:, 0]
    assert counts[:, :, 1:].sum() == 0  # the target that it saw was empty, and so is its answer
    assert counts.sum() > 10_000  # and its mask was not ours
    assert "raised SystemExit: 3" in str(record.rows[1].failure)
    assert "raised BaseException: of no kind" in str(record.rows[2].failure)


def test_rows_whose_results_a_model_removes_are_named_and_made_again(logs, tmp_path):
    (tmp_path / "vandal.py").write_text(
        "import shutil\n"
        "from semgrid_eval.models.model import Model, one_hot\n"
        "class Vandal(Model):\n"
        "    files = ()\n"
        "    def predict(self, batch):\n"
        f"        shutil.rmtree({str(tmp_path / 'run')!r}, ignore_errors=True)\n"
        "        return one_hot(batch.past[:, 0, -1])\n"
    )
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "vandal", "model": f"{tmp_path}/vandal.py:Vandal"}]
    rows.append({"name": "BL-Fuse", "model": "fuse"})
    record = run(rows, logs, tmp_path / "run")
    failures = {row.name: row.failure for row in record.rows}
    assert "its result was removed or damaged while the run went on" in failures.pop("BL-DC")
    gone = failures.pop("vandal").partition("vandal.py:Vandal: changed or removed ")[2]
    assert f"results/{record.rows[2].results[0]}" not in gone
    assert gone.startswith("results/")
    assert gone.endswith(" in the run's folder")
    assert failures == {"BL-Fuse": None}
    assert results.read_run(tmp_path / "run") == record
    again = run(rows, logs, tmp_path / "run", only=("BL-*",))
    assert [row.failure for row in again.rows] == [None, results.NOT_RUN, None]
    for row in (again.rows[0], again.rows[2]):
        results.read_windows(
            tmp_path / "run", results.read_result(results.result_folder(tmp_path / "run", row.results[0])).windows_id
        )


WITH_WEIGHTS = """
from beside import WEIGHTS
from semgrid_eval.models.model import Model, one_hot

class Mine(Model):
    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.known = int(WEIGHTS.read_text())
    def predict(self, batch):
        batch.lead_s.zero_()
        batch.shift_cells.zero_()
        return one_hot(batch.past[:, 0, -1] * self.known)
"""


def test_a_model_with_other_weights_is_scored_again_and_cannot_move_what_others_see(logs, tmp_path):
    (tmp_path / "beside.py").write_text(f"from pathlib import Path\nWEIGHTS = Path({str(tmp_path / 'weights')!r})\n")
    (tmp_path / "mine.py").write_text(WITH_WEIGHTS)
    rows = [{"name": "Mine", "model": f"{tmp_path}/mine.py:Mine"}, {"name": "BL", "model": "newest"}]
    found = {}
    for known in (1, 0):
        (tmp_path / "weights").write_text(str(known))
        record = run(rows, logs, tmp_path / "run")
        assert [row.failure for row in record.rows] == [None, None]
        for row in record.rows:
            counts = read_sums(results.result_folder(tmp_path / "run", row.results[0]), "iou", "all")[:, 0]
            found[row.name, known] = counts.tolist()
    assert found["Mine", 1] == found["BL", 1] == found["BL", 0]
    assert found["Mine", 0] != found["Mine", 1]


def test_models_of_two_folders_do_not_share_what_lies_beside_them(logs, tmp_path):
    rows = []
    for known in (1, 0):
        folder = tmp_path / f"version{known}"
        folder.mkdir()
        (folder / "weights").write_text(str(known))
        (folder / "beside.py").write_text("from pathlib import Path\nWEIGHTS = Path(__file__).parent / 'weights'\n")
        (folder / "mine.py").write_text(WITH_WEIGHTS)
        rows.append({"name": f"Mine{known}", "model": f"{folder}/mine.py:Mine"})
    first, second = (row.results[0] for row in run(rows, logs, tmp_path / "run").rows)
    counts = [read_sums(results.result_folder(tmp_path / "run", name), "iou", "all")[:, 0] for name in (first, second)]
    assert (counts[0] != counts[1]).any()
