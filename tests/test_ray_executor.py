import os
import stat
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support import pieces
from support.pieces import environment, fit_alone, square_or_die

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess, WorkerDied, thread_variables
from semgrid_eval.scores.sums import read_sums

pytestmark = pytest.mark.slow

ray = pytest.importorskip("ray", reason="the extra 'ray' is not installed")
ray.cloudpickle.register_pickle_by_value(pieces)  # the cluster's processes cannot import it


@pytest.fixture(scope="module")
def cluster():
    from semgrid_eval.ray_executor import RayExecutor

    executor = RayExecutor(local_cpus=2)
    yield executor
    executor.close()


def test_a_ray_cluster_gives_every_result_and_names_a_death(cluster):
    results = dict(cluster.run(square_or_die, [1, 2, 3, 4]))
    assert [results[i][0] for i in (0, 1, 3)] == [1, 4, 16]
    assert isinstance(results[2], WorkerDied)
    assert cluster.parallel == 2


def test_a_ray_cluster_names_what_has_no_room(cluster, tmp_path):
    assert dict(cluster.run(partial(fit_alone, tmp_path), ["never"])) == {0: WorkerDied("out of memory")}


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (ray.exceptions.WorkerCrashedError(), "The worker died unexpectedly"),
        (ray.exceptions.OutOfMemoryError("Task was killed\ndue to the node running low on memory"), "Task was killed"),
        (ray.exceptions.LocalRayletDiedError(), "The task's local raylet died"),
        (ray.exceptions.NodeDiedError("Task failed because its node died"), "Task failed because its node died"),
        (ray.exceptions.ObjectLostError("c8ef", None, ""), "Failed to retrieve object c8ef"),
        (ray.exceptions.OwnerDiedError("c8ef", None, ""), "Failed to retrieve object c8ef"),
        (ray.exceptions.ObjectReconstructionFailedError("c8ef"), "Failed to retrieve object c8ef"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else None,
)
def test_a_lost_machine_is_named_and_takes_nobody_elses_work_with_it(cluster, monkeypatch, error, reason):
    get, lost = ray.get, []

    def get_all_but_the_first(reference):
        if not lost:
            lost.append(reference)
            raise error
        return get(reference)

    monkeypatch.setattr(ray, "get", get_all_but_the_first)
    results = list(dict(cluster.run(square_or_die, [1, 1])).values())
    (died,) = (result for result in results if isinstance(result, WorkerDied))
    assert died.reason.startswith(reason)
    assert next(result[0] for result in results if result is not died) == 1


def test_numeric_libraries_have_the_threads_that_a_ray_executor_names(cluster):
    from semgrid_eval.ray_executor import RayExecutor

    for cpus, threads in ((2.0, 2), (0.5, 1)):
        executor = RayExecutor(cpus=cpus)
        assert executor.threads == threads
        ((_, found),) = executor.run(environment, [0])
        assert thread_variables(threads).items() <= found.items()


def listening(pids):
    """Addresses, as the kernel writes them, at which these processes wait for connections."""
    sockets = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            try:
                sockets.add(str(link.readlink()))
            except OSError:  # closed meanwhile
                continue
    lines = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()]
    return [line[1].partition(":")[0] for line in lines if line[3] == "0A" and f"socket:[{line[9]}]" in sockets]


def family():
    """This process, and all that descend from it."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended meanwhile
            continue
    found = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in found} - found:
        found |= more
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="this system does not list its sockets in /proc")
def test_a_cluster_that_is_started_here_is_reached_from_here_alone(cluster):
    dict(cluster.run(square_or_die, [1, 2]))  # so that there are workers
    found = listening(family())
    loopback = {"0100007F", "0000000000000000FFFF00000100007F", "00000000000000000000000001000000"}
    assert len(found) >= 4  # of the control store, the node, and two workers
    assert set(found) <= loopback
    assert os.environ["RAY_AUTH_MODE"] == "token"
    folder = Path(ray._private.worker._global_node.get_session_dir_path()).parents[1]
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_cluster_that_would_be_reached_from_elsewhere_is_refused(cluster, monkeypatch):
    from semgrid_eval.ray_executor import RayExecutor

    class Elsewhere:
        gcs_address = "192.0.2.7:6379"

    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", lambda **options: None)
    monkeypatch.setattr(ray, "shutdown", lambda: None)
    monkeypatch.setattr(ray, "get_runtime_context", Elsewhere)
    with pytest.raises(InputError, match=r"ray: this version of Ray listens on 192\.0\.2\.7:6379, .* its --address"):
        RayExecutor()


def test_ray_that_was_imported_too_early_is_refused(monkeypatch):
    from semgrid_eval.ray_executor import RayExecutor

    monkeypatch.delenv("RAY_AUTH_MODE")
    with pytest.raises(InputError, match="ray: was imported before it was told to listen to this machine alone"):
        RayExecutor()


def test_a_cluster_that_is_too_small_or_absent_is_one_line(cluster):
    from semgrid_eval.ray_executor import RayExecutor

    with pytest.raises(InputError, match="ray: has 2 CPU, and a row asks for 64"):
        RayExecutor(cpus=64)
    cluster.close()
    with pytest.raises(InputError, match=r"ray 127\.0\.0\.1:9: cannot be reached"):
        RayExecutor("127.0.0.1:9")


@pytest.mark.slow
def test_ray_gives_the_same_bytes_as_this_process(tmp_path):
    from support.toy_world import street

    from semgrid_eval.log.store import write_log
    from semgrid_eval.ray_executor import RayExecutor
    from semgrid_eval.runs.matrix import load_matrix
    from semgrid_eval.runs.runner import RunOptions, run_matrix
    from semgrid_eval.scores import results

    for i, split in enumerate(("train", "val")):
        write_log(street(i, frames=9).recording(f"toy{i}", split), tmp_path / "logs" / f"toy{i}.mcap")
    (tmp_path / "own.py").write_text(
        "from semgrid_eval.models.overlay import FuseAll\nclass Own(FuseAll):\n    baseline = False\n"
    )
    (tmp_path / "m.yaml").write_text(
        "defaults: {window: {step_frames: 3, target_frame: 8}}\n"
        "models: {ed: {features: 4, depth: 2,\n"
        "  training: {epochs: 1, updates_per_epoch: 2, batch: 2, precision: float32}}}\n"
        "rows:\n- {name: BL-DC, model: newest}\n- {name: ED-DC, model: ed}\n"
        f"- {{name: own, model: '{tmp_path}/own.py:Own'}}\n"
    )
    matrix = load_matrix(str(tmp_path / "m.yaml"))
    counts = {}
    executor = RayExecutor(local_cpus=2)
    for name, rows_on in (("here", InProcess()), ("ray", executor)):
        options = RunOptions("cpu", tmp_path / "grids", "test", executor=rows_on)
        record = run_matrix(matrix, tmp_path / "logs", tmp_path / name, options)
        assert [row.failure for row in record.rows] == [None] * 3
        counts[name] = [
            read_sums(results.result_folder(tmp_path / name, r.results[0]), "iou", "all")[:, 0] for r in record.rows
        ]
    executor.close()
    for here, there in zip(*counts.values(), strict=True):
        np.testing.assert_array_equal(here, there)
