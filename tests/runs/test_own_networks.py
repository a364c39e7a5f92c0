"""Networks of one's own in a run: trained, kept, resumed and told apart by all that their numbers depend on."""

import pytest
import torch
from support.small_runs import result_of, run

from semgrid_eval.executors import Processes
from semgrid_eval.models import fitting
from semgrid_eval.models.registry import own_models
from semgrid_eval.scores import results
from semgrid_eval.workplace import Limits

pytestmark = pytest.mark.usefixtures("own_models_here")

NETWORK = """
import torch
from layers import SIZE
from semgrid_eval.models.network import Network, NetworkSettings, input_planes

class Small(Network):
    class Settings(NetworkSettings):
        width: int = 4

    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.layers = torch.nn.Sequential(
            torch.nn.Conv2d(given.planes, settings.width, SIZE, padding=SIZE // 2),
            torch.nn.Dropout(0.1),
            torch.nn.Conv2d(settings.width, 10, 1),
        )

    def forward(self, batch):
        return self.layers(input_planes(batch.past))

    def loss(self, logits, batch):
        return super().loss(logits, batch) + 0.01 * logits.square().mean()
"""
TRAINING = {"epochs": 2, "updates_per_epoch": 3, "batch": 2}


@pytest.fixture
def small(tmp_path):
    """A network in a file, which imports its neighbour."""
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "small.py").write_text(NETWORK)
    (folder / "layers.py").write_text("SIZE = 3\n")
    return f"{folder}/small.py:Small"


def own_row(small, **more):
    return {"name": "own", "model": small, "settings": {"training": TRAINING}, **more}


def test_an_own_network_is_trained_like_a_built_in_one(logs, tmp_path, small):
    axes = {"grid": {"settings.width": [4, 6]}}
    row = own_row(small, repeats=2, axes=axes) | {"name": "w{settings.width}"}
    out = tmp_path / "run"
    record = run([row], logs, out)
    assert [row.name for row in record.rows] == ["w4", "w6"]
    found = [result_of(out, row) for row in record.rows]
    assert [result.parameters for result in found] == [4 * (20 * 9 + 1) + 50, 6 * (20 * 9 + 1) + 70]
    assert [result.seed for result in found] == [5, 5]
    assert found[0].facts.learns
    assert found[0].facts.family == "Small"
    assert found[0].config["settings"]["training"]["epochs"] == 2
    assert len({result for row in record.rows for result in row.results}) == 4
    assert len(list((out / "trainings").iterdir())) == 4
    history = results.read_history(results.result_folder(out, record.rows[0].results[0]))
    assert list(history["epoch"]) == [1, 2]
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file() and path.name != "run.json"}
    run([row], logs, out)  # nothing is trained or scored again
    assert before == {path: path.stat().st_mtime_ns for path in before}


@pytest.mark.slow
def test_an_own_network_ends_in_the_same_bytes_after_a_stop_and_in_other_processes(logs, tmp_path, small, monkeypatch):
    def outputs(out):
        files = [*out.glob("results/*/sums.npz"), *out.glob("trainings/*/weights.safetensors")]
        return {str(path.relative_to(out)): path.read_bytes() for path in files}

    whole, stopped, elsewhere, apart = (tmp_path / name for name in ("whole", "stopped", "elsewhere", "apart"))
    run([own_row(small)], logs, whole)
    trained = fitting.train

    def stop_after_an_epoch(*arguments, **options):
        def progress(done, total, message=""):
            if done > 3:
                raise KeyboardInterrupt

        return trained(*arguments, **options | {"progress": progress})

    monkeypatch.setattr(fitting, "train", stop_after_an_epoch)
    with pytest.raises(KeyboardInterrupt):
        run([own_row(small)], logs, stopped)
    assert len(list(stopped.glob("trainings/*/checkpoint.pt"))) == 1
    monkeypatch.undo()
    run([own_row(small)], logs, stopped)
    run([own_row(small)], logs, elsewhere, Processes(2, threads=torch.get_num_threads()))
    with own_models(Limits()):
        run([own_row(small)], logs, apart)
    assert len(outputs(whole)) == 2
    assert outputs(whole) == outputs(stopped) == outputs(elsewhere) == outputs(apart)


def test_a_network_is_told_apart_by_its_file_its_neighbours_and_its_settings(logs, tmp_path, small):
    folder, out = tmp_path / "models", tmp_path / "run"
    changes = [
        ("small.py", NETWORK),
        ("small.py", NETWORK + "\n# changed"),
        ("layers.py", "SIZE = 5\n"),
        ("unused.py", "changed\n"),
    ]
    found = []
    for name, text in changes:
        (folder / name).write_text(text)
        (row,) = run([own_row(small)], logs, out).rows
        found.append((result_of(out, row).id, len(list((out / "trainings").iterdir()))))
    assert [trainings for _, trainings in found] == [1, 2, 3, 3]
    assert len({result for result, _ in found}) == 3
    assert found[3] == found[2]
    (row,) = run([own_row(small) | {"settings": {"width": 2, "training": TRAINING}}], logs, out).rows
    assert result_of(out, row).id not in dict(found)


FAULTY = """
import torch
from semgrid_eval.models.network import Network, input_planes

class Wrong(Network):
    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.layer = torch.nn.Conv2d(given.planes, 9, 1)

    def forward(self, batch):
        return self.layer(input_planes(batch.past))

class Function(torch.autograd.Function):
    @staticmethod
    def forward(context, values):
        return values * 1.0

    @staticmethod
    def backward(context, gradient):
        raise KeyError("gone")

class Backward(Wrong):
    def forward(self, batch):
        return torch.nn.functional.pad(Function.apply(super().forward(batch)), (0, 0, 0, 0, 0, 1))
"""


def test_faults_of_a_network_while_it_is_trained_are_one_line_each(logs, tmp_path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    rows = [
        {"name": name, "model": f"{tmp_path}/faulty.py:{name}", "settings": {"training": dict(TRAINING)}}
        for name in ("Wrong", "Backward")
    ]
    record = run([*rows, {"name": "BL-DC", "model": "newest"}], logs, tmp_path / "run")
    assert [row.failure for row in record.rows] == [
        f"{tmp_path}/faulty.py:Wrong: scores 9 classes, and bicycle are missing",
        "KeyError: 'gone'",
        None,
    ]
