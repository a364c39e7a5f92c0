"""Work on a Ray cluster of four nodes, each of which is lost in the middle of something, is the work of one process."""

import json
import os
import shutil
import tempfile
from pathlib import Path

import pytest
import torch
import yaml
from support import page_runs, spread
from support.cityscapes_tree import Tree, put
from support.small_runs import run
from support.spread import begun, contents, losing_a_node

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess
from semgrid_eval.grids.build import build_grids
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.convert import Work
from semgrid_eval.log.store import find_logs
from semgrid_eval.scores import results
from semgrid_eval.sources.cityscapes.source import CityscapesOptions
from semgrid_eval.sources.cityscapes.tree import convert_cityscapes

ray = pytest.importorskip("ray", reason="the extra 'ray' is not installed")
ray.cloudpickle.register_pickle_by_value(spread)  # the cluster's processes cannot import it
pytestmark = pytest.mark.slow

NODES, RECORDINGS = 4, 8
VARYING = {"train_seconds", "predict_seconds", "seal"}
ROWS = [
    {"name": "BL-DC", "model": "newest"},
    {"name": "BL-NT", "model": "newest", "translate": False},
    {"name": "ED", "model": "ed", "repeats": 5},
]


@pytest.fixture(scope="module")
def cluster():
    from ray.cluster_utils import Cluster

    folder = Path(tempfile.mkdtemp(prefix="ray-"))  # pytest's are too long for the names of sockets
    Path(tempfile.gettempdir(), "ray").mkdir(
        exist_ok=True
    )  # where Ray writes the cluster's address, wherever its files lie
    head = {"num_cpus": 1, "include_dashboard": False, "temp_dir": str(folder)}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    for _ in range(NODES - 1):
        cluster.add_node(num_cpus=1)
    yield cluster
    cluster.shutdown()
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def executor(cluster):
    from semgrid_eval.ray_executor import RayExecutor

    executor = RayExecutor(cluster.address)
    yield executor
    executor.close()


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A tree of recordings with label images in two splits."""
    folder = tmp_path_factory.mktemp("shared")
    for split, city in (("train", "aachen"), ("val", "ulm")):
        tree = Tree(folder / "tree", split=split, city=city)
        for sequence in range(RECORDINGS // 2):
            for name in tree.write(range(9), sequence=sequence):
                put(folder / "labels" / f"{name}_predLabelIds.png", tree.label(highest=33))
    return folder


def options(shared):
    return CityscapesOptions(src=shared / "tree", labels=shared / "labels")


def convert(shared, out, executor):
    summary = convert_cityscapes(options(shared), out, Work(1, executor))
    assert (len(summary.written), summary.failed) == (RECORDINGS, {})
    return contents(out)


def result_files(out, record):
    """Return what a run has found, by result and file, without how long it took."""
    found = {}
    for row in record.rows:
        assert row.failure is None, row.failure
        for name in row.results:
            folder = results.result_folder(out, name)
            files = contents(folder, without=(results.HISTORY_FILE, "result.json"))
            told = json.loads((folder / "result.json").read_text())
            found[name] = files | {"result": {key: value for key, value in told.items() if key not in VARYING}}
    return found


def test_a_node_is_lost_in_each_of_convert_grids_and_run_and_all_bytes_are_those_of_one_process(
    cluster, executor, tree, tmp_path, capsys
):
    torch.set_num_threads(executor.threads)
    logs = tmp_path / "logs"
    with losing_a_node(cluster, executor, tmp_path / "converting") as there:
        assert convert(tree, logs, there) == convert(tree, tmp_path / "here", InProcess())
    assert len(list(logs.rglob("*.part"))) == 1  # the next command removes it
    assert convert_cityscapes(options(tree), logs).written == []
    assert list(logs.rglob("*.part")) == []

    paths = find_logs(logs)
    with losing_a_node(cluster, executor, tmp_path / "building") as there:
        built = build_grids(paths, tmp_path / "grids", GridConfig(), executor=there)
    assert (built.built, built.failed) == (RECORDINGS, {})
    build_grids(paths, tmp_path / "grids-here", GridConfig())
    assert contents(tmp_path / "grids") == contents(tmp_path / "grids-here")

    found, trained = {}, {}
    with losing_a_node(cluster, executor, tmp_path / "running") as there:
        for name, place in (("run", there), ("run-here", InProcess())):
            record = run(ROWS, logs, tmp_path / name, place)
            found[name] = result_files(tmp_path / name, record)
            trained[name] = contents(tmp_path / name / "trainings", without=("history.csv",))
    assert len(found["run"]) == 2 + 5
    assert found["run"] == found["run-here"]
    assert trained["run"] == trained["run-here"]
    assert len(trained["run"]) == 5
    again = [sum(begun(tmp_path / name).values()) for name in ("converting", "building", "running")]
    assert again == [RECORDINGS + 1, RECORDINGS + 1, 7 + 1]  # what the lost node had begun was begun once more
    assert capsys.readouterr().out == ""


def test_the_commands_of_the_page_run(cluster, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for split, city in (("train", "aachen"), ("val", "ulm")):
        tree = Tree(Path("SRC"), split=split, city=city)
        for name in tree.write(range(30)):
            put(Path(f"PREDICTIONS/{name}_predLabelIds.png"), tree.label())
    ed = {"features": 4, "depth": 2, "training": {"epochs": 1, "updates_per_epoch": 2, "batch": 2}}
    rows = [{"name": "BL-DC", "model": "newest"}, {"name": "ED-SL2", "model": "ed", "settings": ed}]
    Path("small.yaml").write_text(yaml.safe_dump({"rows": rows}))
    instead = {"HOST:6379": cluster.address, "paper-cpu": "small.yaml", "16": "1"}
    try:
        page_runs.run("docs/cluster.md", instead=instead)
    finally:
        ray.shutdown()  # a command's process would end
    found = {name: results.read_run(Path("runs") / name).rows for name in ("paper", "part", "whole")}
    assert {name: [len(row.results) for row in rows] for name, rows in found.items()} == {
        "paper": [1, 1],
        "part": [0, 1],
        "whole": [1, 1],
    }


def test_a_folder_that_other_machines_do_not_see_is_one_line(executor, tmp_path):
    mine = Path("/proc/self/task") / str(os.getpid())  # of this process alone
    with pytest.raises(
        InputError, match=rf"{mine}: ray: is not seen by the machine .*; all of a cluster must reach it"
    ):
        executor.check_shared([tmp_path, mine], tmp_path / "out")
    executor.check_shared([tmp_path], tmp_path / "out")
    assert contents(tmp_path / "out") == {}
