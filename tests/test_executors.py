import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest
from support.pieces import environment, fit_alone, square_or_die, threads_of_libraries, write_a_minute

from semgrid_eval.errors import InputError
from semgrid_eval.executors import InProcess, Processes, WorkerDied, available_cores, local_executor, thread_variables
from semgrid_eval.files import read_json

BUSY_PARENT = """
import signal
import sys
from pathlib import Path

from semgrid_eval.executors import Processes
from support.pieces import write_a_minute

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what it puts in the background ignore it

def work():
    for _ in Processes(2).run(write_a_minute, [Path(name) for name in sys.argv[1:]]):
        raise KeyboardInterrupt

try:
    work()
except KeyboardInterrupt:
    sys.exit("stopped")
"""


def be_deaf_or_wait_for_one_who_is(path):
    if path.name == "deaf":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        path.touch()
        time.sleep(60)
    while not path.with_name("deaf").exists():
        time.sleep(0.02)


def raise_what_cannot_be_copied(_item):
    error = ValueError("of a kind that cannot be copied")
    error.process = threading.Lock()
    raise error


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


@pytest.fixture
def busy_parent(tmp_path):
    """Give a process whose two workers have begun; its standard output ends when the last of the three ends."""
    command = [sys.executable, "-c", BUSY_PARENT, *(str(tmp_path / name) for name in ("slow", "first", *"abcd"))]
    parent = subprocess.Popen(
        command, cwd=Path(__file__).parent, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert {parent.stdout.readline() for _ in range(2)} == {"first\n", "slow\n"}
        yield parent
    finally:
        parent.kill()
        parent.communicate()


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


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_processes_end_with_a_parent_that_is_killed(busy_parent, number):
    busy_parent.send_signal(number)
    assert busy_parent.communicate(timeout=30)[0] == ""


def test_ctrl_c_drops_what_has_not_begun_and_breaks_off_what_has(busy_parent, tmp_path):
    busy_parent.send_signal(signal.SIGINT)
    assert busy_parent.communicate(timeout=30) == ("", "stopped\n")
    assert list(tmp_path.iterdir()) == []


def test_an_error_at_a_result_drops_what_has_not_begun_and_breaks_off_what_has(busy_parent, tmp_path):
    (tmp_path / "go on").touch()
    begun, errors = busy_parent.communicate(timeout=30)
    assert begun in ("", "a\n")  # the process whose result it was has been given its next
    assert errors == "stopped\n"
    assert {path.name for path in tmp_path.iterdir()} == {"first", "go on"}


def test_leaving_an_iteration_does_not_wait_for_what_is_worked_on(tmp_path):
    (tmp_path / "go on").touch()
    start_s = time.monotonic()
    for index, _ in Processes(2).run(write_a_minute, [tmp_path / "slow", tmp_path / "first"]):
        assert index == 1
        break
    assert time.monotonic() - start_s < 30
    assert not multiprocessing.active_children()


def test_a_process_that_does_not_end_when_told_to_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr("semgrid_eval.executors._GRACE_S", 0.2)
    start_s = time.monotonic()
    next(Processes(2).run(be_deaf_or_wait_for_one_who_is, [tmp_path / "deaf", tmp_path / "other"]))
    assert time.monotonic() - start_s < 30
    assert not multiprocessing.active_children()


def test_an_error_of_the_function_is_raised_here_and_says_where_it_was(tmp_path):
    with pytest.raises(InputError, match="missing: cannot be read") as caught:
        list(Processes(2).run(read_json, [tmp_path / "missing"]))
    assert "in read_json" in caught.value.__notes__[0]
    with pytest.raises(RuntimeError, match=r"\nValueError: of a kind that cannot be copied"):
        list(Processes(2).run(raise_what_cannot_be_copied, [0]))


def test_numeric_libraries_have_the_threads_that_an_executor_names():
    executor = Processes(2, threads=3)
    assert executor.threads == 3
    assert all(thread_variables(3).items() <= found.items() for _, found in executor.run(environment, range(2)))
    assert dict(Processes(2, threads=1).run(threads_of_libraries, range(2))) == {0: (1, 1, 1), 1: (1, 1, 1)}
    assert Processes(2).threads == max(1, available_cores() // 2)
    assert InProcess().threads is None


def test_gpus_are_shared_out_among_processes(tmp_path):
    ran = dict(Processes(3, gpus=("4", "GPU-5")).run(partial(gpu_when_all_have_begun, tmp_path, 3), range(3)))
    assert len({pid for pid, _ in ran.values()}) == 3
    assert sorted(gpu for _, gpu in ran.values()) in (["4", "4", "GPU-5"], ["4", "GPU-5", "GPU-5"])


def test_what_finds_no_room_beside_others_is_tried_alone(tmp_path):
    found = dict(Processes(2).run(partial(fit_alone, tmp_path), ["a", "b", "never"]))
    assert found == {0: "a", 1: "b", 2: WorkerDied("out of memory")}
    assert dict(InProcess().run(partial(fit_alone, tmp_path), ["a", "c"])) == {0: "a", 1: WorkerDied("out of memory")}
