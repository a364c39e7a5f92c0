import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from support.cityscapes_tree import Tree

from semgrid_eval.cli.main import main

LIMIT_S = 60


def start(*arguments):
    """Start the command line in a process of its own."""
    command = [sys.executable, "-m", "semgrid_eval.cli.main", *(str(argument) for argument in arguments)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def until(found):
    """Wait for what a function finds and return it."""
    end_s = time.monotonic() + LIMIT_S
    while time.monotonic() < end_s:
        if result := found():
            return result
        time.sleep(0.01)
    raise AssertionError("it did not come about in time")


def opened(pipe):
    """Open a named pipe to write to, once somebody reads it."""

    def attempt():
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            return None

    return until(attempt)


def told_at_termination(process):
    """Terminate a process; return its exit code and what it says."""
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=LIMIT_S)
    return process.returncode, said.strip()


def test_help_does_not_wait_for_heavy_packages():
    program = """
import sys
from semgrid_eval.cli.main import cli
cli.main(["--help"], standalone_mode=False)
print(sorted({"numpy", "pandas", "torch", "cv2"} & sys.modules.keys()))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    *shown, heavy = done.stdout.splitlines()
    assert heavy == "[]"
    assert sum(line.startswith("  ") for line in shown) > 9  # every command, with a line of help


def test_a_terminated_conversion_leaves_nothing_half_written_and_says_that_it_goes_on(tmp_path):
    tree, logs = Tree(tmp_path / "src"), tmp_path / "logs"
    (name,) = tree.write([0])
    (tmp_path / "labels").mkdir()
    os.mkfifo(tmp_path / "labels" / f"{name}.png")
    process = start("convert", "cityscapes", tree.root, logs, "--labels", tmp_path / "labels", "--workers", 1)
    digested = opened(tmp_path / "labels" / f"{name}.png")
    os.write(digested, tree.label())
    os.close(digested)
    until(lambda: list(logs.rglob("*.part")))
    converted = opened(tmp_path / "labels" / f"{name}.png")
    assert told_at_termination(process) == (130, "Stopped; the same command continues from here.")
    os.close(converted)
    assert [path for path in logs.rglob("*") if path.is_file()] == []


def test_a_terminated_check_does_not_say_that_it_goes_on(tmp_path):
    os.mkfifo(tmp_path / "log.mcap")
    process = start("check", tmp_path / "log.mcap")
    read = opened(tmp_path / "log.mcap")
    assert told_at_termination(process) == (130, "Stopped.")
    os.close(read)


@pytest.fixture
def handler():
    """A handler of SIGTERM that somebody else has set."""
    before = signal.signal(signal.SIGTERM, lambda number, frame: None)
    yield signal.getsignal(signal.SIGTERM)
    signal.signal(signal.SIGTERM, before)


def version():
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0


def test_the_command_line_leaves_signals_as_they_were(handler):
    version()
    assert signal.getsignal(signal.SIGTERM) is handler
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    version()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_the_command_line_can_be_called_in_another_thread():
    codes = []

    def call():
        try:
            main(["--version"])
        except SystemExit as stop:
            codes.append(stop.code)

    thread = threading.Thread(target=call)
    thread.start()
    thread.join(LIMIT_S)
    assert codes == [0]
