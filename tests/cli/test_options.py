"""The same commands in this machine's processes and on a Ray cluster that is started here, with the same results."""

from pathlib import Path

import pytest
from click.testing import CliRunner
from support.cityscapes_tree import Tree, put

from semgrid_eval.cli.main import cli
from semgrid_eval.cli.options import Folders, chosen_executor
from semgrid_eval.executors import InProcess, Processes
from semgrid_eval.log.store import find_logs
from semgrid_eval.scores.results import read_run, result_folder

ray = pytest.importorskip("ray", reason="the extra 'ray' is not installed")
MATRIX = """
defaults: {window: {step_frames: 1, target_frame: 2}}
rows:
- {name: BL-DC, model: newest}
"""
MODEL = """
import torch

from semgrid_eval import Model


class Unknown(Model):
    def predict(self, batch):
        return torch.eye(10)[torch.zeros(batch.target.shape, dtype=torch.long)].permute(0, 3, 1, 2)
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tree = Tree(tmp_path / "cityscapes")
    for name in tree.write(range(3)):
        put(tmp_path / "labels" / f"{name}_predLabelIds.png", tree.label(highest=33))
    (tmp_path / "m.yaml").write_text(MATRIX)
    (tmp_path / "mine.py").write_text(MODEL)
    return tmp_path


def call(*arguments):
    result = CliRunner().invoke(cli, [*arguments, "--workers", "1"], standalone_mode=False, catch_exceptions=False)
    assert result.return_value == 0, result.output


def test_workers_say_how_many_processes_there_are():
    assert isinstance(chosen_executor("local", "local", 1, Folders([], Path("out"))), InProcess)
    several = chosen_executor("local", "local", 3, Folders([], Path("out")), shared=("0",))
    assert isinstance(several, Processes)
    assert several.parallel == 3


@pytest.mark.slow
def test_convert_grids_and_run_do_on_ray_what_they_do_here(here):
    for where, options in (("here", ()), ("ray", ("--executor", "ray"))):
        call("convert", "cityscapes", "cityscapes", f"{where}/logs", "--labels", "labels", *options)
        call("grids", f"{where}/logs", f"{where}/grids", *options)
        run = ("run", "m.yaml", "--model", "mine.py:Unknown", "--logs", f"{where}/logs", "--grids", f"{where}/grids")
        call(*run, "--out", f"{where}/run", *options)
    ray.shutdown()
    assert [log.read_bytes() for log in find_logs(here / "here")] == [
        log.read_bytes() for log in find_logs(here / "ray")
    ]
    rows, again = (read_run(here / where / "run").rows for where in ("here", "ray"))
    assert [(row.name, row.facts.family, row.failure) for row in rows] == [
        ("BL-DC", "BL", None),
        ("Unknown", "Unknown", None),
    ]
    assert rows == again
    for row in rows:
        counts = [
            (result_folder(here / where / "run", row.results[0]) / "sums.npz").read_bytes() for where in ("here", "ray")
        ]
        assert counts[0] == counts[1]
