import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner
from support.cityscapes_tree import Tree
from support.driving import driving

import semgrid_eval
from semgrid_eval.cli.main import cli, main
from semgrid_eval.errors import InputError
from semgrid_eval.log.store import write_log

LIMIT_S = 60


STOPPED_AT = """
import signal
import sys
import {module} as module

def wait(*arguments, **options):
    print("there", flush=True)
    while True:
        signal.pause()

{place} = wait
from semgrid_eval.cli.main import main
main(sys.argv[1:])
"""


def start(place, *arguments):
    """Run the command line in a process of its own up to a call, which never ends, and return it."""
    program = STOPPED_AT.format(module=place.rpartition(":")[0], place=f"module.{place.rpartition(':')[2]}")
    command = [sys.executable, "-c", program, *(str(argument) for argument in arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "there\n"
    return process


def told_at_termination(process):
    """Terminate a process; return its exit code and what it says."""
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=LIMIT_S)
    return process.returncode, said.strip()


@pytest.mark.parametrize(
    ("words", "meant"),
    [(("repot", "runs/first"), "report"), (("convert", "town-v2", "logs"), "town-v1"), (("qqq",), None)],
)
def test_a_misspelt_command_is_told_which_was_meant(words, meant):
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 2
    last = done.output.splitlines()[-1]
    name = next(word for word in words if word != "convert")
    assert last.startswith(f"Error: command {name!r} is not one of ")
    assert last.endswith(f"; did you mean {meant}?" if meant else ", bench")


def test_the_package_runs_as_the_command_does():
    for module in ("semgrid_eval", "semgrid_eval.cli.main"):
        done = subprocess.run([sys.executable, "-m", module, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"semgrid-eval, version {semgrid_eval.__version__}\n"


def test_a_terminated_conversion_leaves_nothing_half_written_and_says_that_it_goes_on(tmp_path):
    tree, logs = Tree(tmp_path / "src"), tmp_path / "logs"
    tree.write([0])
    there = "semgrid_eval.log.writer:MomentWriter.write"
    process = start(there, "convert", "cityscapes", tree.root, logs, "--workers", 1)
    assert len(list(logs.rglob("*.part"))) == 1
    assert told_at_termination(process) == (130, "Stopped; the same command continues from here.")
    assert [path for path in logs.rglob("*") if path.is_file()] == []


def test_a_terminated_check_does_not_say_that_it_goes_on(tmp_path):
    (tmp_path / "log.mcap").touch()
    process = start("semgrid_eval.log.check:check_log", "check", tmp_path / "log.mcap")
    assert told_at_termination(process) == (130, "Stopped.")


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


CLOSED = """
import os
import sys

for number in map(int, sys.argv.pop(1).split(",")):
    os.close(number)
os.execv(sys.executable, [sys.executable, "-m", "semgrid_eval.cli.main", *sys.argv[1:]])
"""


def called(*arguments, stdout=subprocess.PIPE, closed=""):
    """Run the command line, some of its standard streams closed."""
    program = ["-c", CLOSED, closed] if closed else ["-m", "semgrid_eval.cli.main"]
    command = [sys.executable, *program, *(str(argument) for argument in arguments)]
    return subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "log.mcap"
    write_log(driving(), path)
    return path


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux has it")
@pytest.mark.parametrize("options", [["--json"], []])
def test_a_full_output_is_one_line_and_exit_code_1(log, options):
    with Path("/dev/full").open("w") as full:
        done = called("check", log, *options, stdout=full)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "Error: the output: No space left on device"
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


@pytest.mark.parametrize("closed", ["2", "0,2", "0,1,2"])
def test_closed_streams_change_neither_work_nor_exit_code(log, tmp_path, closed):
    assert called("check", log, closed=closed).returncode == 0
    assert called("check", tmp_path / "none.mcap", closed=closed).returncode == 2
    (tmp_path / "bad.mcap").write_bytes(b"bad")
    assert called("check", tmp_path / "bad.mcap", closed=closed).returncode == 3


def test_a_reader_that_leaves_early_is_no_error_of_ours(log):
    reader, writer = os.pipe()
    os.close(reader)
    done = called("check", log, stdout=writer)
    os.close(writer)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "Error" not in done.stderr


def test_names_with_control_characters_are_shown_escaped(tmp_path, capsys):
    name = "\x1b[31mred\u202e\n.mcap"
    (tmp_path / name).write_bytes(b"bad")
    with pytest.raises(SystemExit):
        main(["check", str(tmp_path / name)])
    with pytest.raises(SystemExit):
        main(["grids", str(tmp_path), str(tmp_path / "out")])
    said = capsys.readouterr()
    for text in (said.out, said.err):
        assert all(line.isprintable() for line in text.splitlines())
        assert "\\x1b[31mred\\u202e\\n.mcap" in text


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (InputError("is odd", field="any_machine"), "--any-machine: is odd"),
        (InputError("is odd", field="out"), "--out: is odd"),
        (InputError("is odd", field="matrix"), "matrix: is odd"),
        (InputError("is odd", field="sensors"), "sensors: is odd"),
        (InputError("is odd", path="a.yaml", field="out"), "a.yaml: out: is odd"),
    ],
)
def test_an_option_is_named_as_it_is_typed_and_nothing_else_is(monkeypatch, tmp_path, capsys, error, line):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr("semgrid_eval.runs.matrix.load_matrix", fail)
    with pytest.raises(SystemExit) as stop:
        main(["run", "smoke", "--logs", str(tmp_path), "--out", str(tmp_path / "out")])
    assert (stop.value.code, capsys.readouterr().err) == (1, f"Error: {line}\n")
