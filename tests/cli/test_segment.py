import shlex
import sys

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")

from support.coloured import TRAIN_COLOURS, coloured, expected_labels
from support.onnx_models import colour_network

from semgrid_eval.cli.main import main
from semgrid_eval.cli.segment import command
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import write_log
from semgrid_eval.recording.png import decode_gray

PLAIN = ("--mean", 0, 0, 0, "--std", 1, 1, 1)


def run(*arguments):
    """Run the command line and return its exit code."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return caught.value.code


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder to work in, with a log and a network."""
    write_log(coloured(), tmp_path / "logs/val/street.mcap")
    colour_network(tmp_path / "network.onnx", colours=TRAIN_COLOURS)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_example_of_the_help_runs(place, capsys):
    program, *arguments = shlex.split(command.epilog.removeprefix("Example: "))
    assert program == "semgrid-eval"
    assert run(*arguments) == 0
    said = capsys.readouterr().err
    assert "labelled: 1 written, 0 up to date, 0 failed\n" in said
    assert said.endswith("labels: network.onnx on cpu, its classes by the map cityscapes\n")
    assert check_log(place / "labelled/val/street.mcap").good


def test_options_reach_the_network(place):
    assert run("segment", "logs", "--model", "network.onnx", "--out", "labelled", *PLAIN, "--workers", 1) == 0
    with LogReader(place / "labelled/val/street.mcap") as log:
        for number, frame in enumerate(log.frames("front")):
            assert np.array_equal(decode_gray(frame.label_png, bit_depth=8), expected_labels(number))


def test_failed_log_gives_exit_code_1(place, capsys):
    write_log(coloured(without=tuple(range(4))), place / "blind/street.mcap")
    assert run("segment", "blind", "--model", "network.onnx", "--out", "labelled") == 1
    said = capsys.readouterr()
    assert "Error: val/street: street: has no colour image\n" in said.err
    assert said.out == ""


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("--std", 1, 0, 1), "Error: --std: must be above 0, not 0.0\n"),
        (("--size", 0, 8), "Error: --size: must be at least 1, not 0\n"),
        (("--classes", "citscapes"), "Error: --classes: 'citscapes' is neither a file nor one of cityscapes, "),
        (("--device", "gpu"), "Error: --device: there is no device 'gpu' for ONNX Runtime; use auto, cpu or cuda\n"),
        (("--device", "cuda"), "Error: --device: this ONNX Runtime cannot use 'cuda'; install onnxruntime-gpu "),
        (("--output", "aux"), "Error: network.onnx: output: there is no aux; there are: answer\n"),
        (
            ("--classes", "cityscapes-ids", "--out", "logs"),
            "Error: logs: out: contains or is inside logs; new logs need a folder",
        ),
    ],
)
def test_mistakes_are_one_line(place, capsys, option, message):
    assert run("segment", "logs", "--model", "network.onnx", "--out", "labelled", *option) == 1
    said = capsys.readouterr().err
    assert said.startswith(message)
    assert said.count("\n") == 1


def test_missing_extra_is_named(place, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert run("segment", "logs", "--model", "network.onnx", "--out", "labelled") == 1
    assert capsys.readouterr().err == "Error: onnxruntime is not installed; run: pip install 'semgrid-eval[segment]'\n"
