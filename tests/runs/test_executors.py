import os
import time
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess, NoRoomError, Processes, WorkerDied, local_executor

ray = pytest.importorskip("ray", reason="the extra 'ray' is not installed")


def square_or_die(value):
    if value == 3:
        os._exit(1)
    return value * value, os.getpid()


def work_a_while_or_die(value):
    """Tell when this was worked on."""
    if value == 3:
        os._exit(1)
    start_s = time.monotonic()
    time.sleep(0.6)
    return start_s, time.monotonic()


def gpu_when_all_have_begun(folder, expected, _item):
    """Wait until that many processes have begun, so that each of them has work, and name this one's GPU."""
    (folder / str(os.getpid())).touch()
    end_s = time.monotonic() + 120
    while len(list(folder.iterdir())) < expected and time.monotonic() < end_s:
        time.sleep(0.05)
    return os.getpid(), os.environ.get("CUDA_VISIBLE_DEVICES")


def fit_alone(folder, item):
    """Find room at the second time of asking, or never."""
    if item == "never" or not (folder / item).exists():
        (folder / item).touch()
        raise NoRoomError("out of memory")
    return item


@pytest.fixture(scope="module")
def cluster():
    from semgrid_eval.runs.executors import RayExecutor

    executor = RayExecutor(local_cpus=2)
    yield executor
    executor.close()


def test_one_worker_means_this_process():
    assert isinstance(local_executor(1), InProcess)
    assert [index for index, _ in InProcess().run(abs, [-1, -2])] == [0, 1]


def test_processes_give_every_result_and_name_a_death():
    results = dict(Processes(2).run(square_or_die, [1, 2]))
    assert {index: value for index, (value, _) in results.items()} == {0: 1, 1: 4}
    assert all(pid != os.getpid() for _, pid in results.values())
    assert WorkerDied() in dict(Processes(2).run(square_or_die, [3])).values()


def test_a_process_that_is_killed_takes_nobody_elses_work_with_it():
    results = dict(Processes(2).run(square_or_die, [1, 3, 2, 4]))
    assert results.pop(1) == WorkerDied()
    assert {index: value for index, (value, _) in results.items()} == {0: 1, 2: 4, 3: 16}


def test_what_a_killed_process_had_not_begun_goes_on_together():
    results = dict(Processes(2).run(work_a_while_or_die, [3, *range(10, 16)]))
    assert results.pop(0) == WorkerDied()
    times = sorted(results.values())
    assert len(times) == 6
    assert any(later < end for (_, end), (later, _) in pairwise(times))


def test_gpus_are_shared_out_among_processes(tmp_path):
    ran = dict(Processes(3, gpus=("4", "GPU-5")).run(partial(gpu_when_all_have_begun, tmp_path, 3), range(3)))
    assert len({pid for pid, _ in ran.values()}) == 3
    assert sorted(gpu for _, gpu in ran.values()) in (["4", "4", "GPU-5"], ["4", "GPU-5", "GPU-5"])


def test_what_finds_no_room_beside_others_is_tried_alone(tmp_path):
    found = dict(Processes(2).run(partial(fit_alone, tmp_path), ["a", "b", "never"]))
    assert found == {0: "a", 1: "b", 2: WorkerDied("out of memory")}
    assert dict(InProcess().run(partial(fit_alone, tmp_path), ["a", "c"])) == {0: "a", 1: WorkerDied("out of memory")}


def test_a_ray_cluster_gives_every_result_and_names_a_death(cluster):
    results = dict(cluster.run(square_or_die, [1, 2, 3, 4]))
    assert [results[i][0] for i in (0, 1, 3)] == [1, 4, 16]
    assert isinstance(results[2], WorkerDied)
    assert cluster.parallel == 2


def test_a_ray_cluster_names_what_has_no_room(cluster, tmp_path):
    assert dict(cluster.run(partial(fit_alone, tmp_path), ["never"])) == {0: WorkerDied("out of memory")}


def test_a_cluster_that_is_too_small_or_absent_is_one_line(cluster):
    from semgrid_eval.runs.executors import RayExecutor

    with pytest.raises(InputError, match="ray: has 2 CPU, and a row asks for 64"):
        RayExecutor(cpus=64)
    cluster.close()
    with pytest.raises(InputError, match=r"ray 127\.0\.0\.1:9: cannot be reached"):
        RayExecutor("127.0.0.1:9")


def test_ray_gives_the_same_bytes_as_this_process(tmp_path):
    from support.toy_world import street

    from semgrid_eval.log.store import write_log
    from semgrid_eval.runs.executors import RayExecutor
    from semgrid_eval.runs.matrix import load_matrix
    from semgrid_eval.runs.runner import RunOptions, run_matrix
    from semgrid_eval.scores import results

    for i, split in enumerate(("train", "val")):
        write_log(street(i, frames=9).recording(f"toy{i}", split), tmp_path / "logs" / f"toy{i}.mcap")
    (tmp_path / "m.yaml").write_text(
        "defaults: {window: {step_frames: 3, target_frame: 8}, network: {features: 4, depth: 2},\n"
        "  training: {epochs: 1, updates_per_epoch: 2, batch: 2, precision: float32}}\n"
        "rows:\n- {name: BL-DC, model: newest}\n- {name: ED-DC, model: ed}\n"
    )
    matrix = load_matrix(str(tmp_path / "m.yaml"))
    counts = {}
    executor = RayExecutor(local_cpus=2)
    for name, rows_on in (("here", InProcess()), ("ray", executor)):
        options = RunOptions("cpu", tmp_path / "grids", "test", executor=rows_on)
        record = run_matrix(matrix, tmp_path / "logs", tmp_path / name, options)
        assert [row.failure for row in record.rows] == [None, None]
        counts[name] = [
            results.read_counts(results.result_folder(tmp_path / name, r.results[0]))[0] for r in record.rows
        ]
    executor.close()
    for here, there in zip(*counts.values(), strict=True):
        np.testing.assert_array_equal(here, there)
