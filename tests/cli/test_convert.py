import os
import shlex
import sys
from pathlib import Path

import pytest
from support.cityscapes_tree import Tree, put

from semgrid_eval.cli.convert import command
from semgrid_eval.cli.main import main
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.sources.known import load_source


def run(*arguments):
    """Run the command line and return its exit code."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return caught.value.code


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path / "cityscapes")


def labelled(tree, folder, *, kind="LabelIds", highest=33):
    for name in tree.write(range(3)):
        put(folder / f"{name}_pred{kind}.png", tree.label(highest=highest))


def test_example_of_the_help_runs(tree, tmp_path, monkeypatch, capsys):
    labelled(tree, tmp_path / "predictions")
    monkeypatch.chdir(tmp_path)
    program, *arguments = shlex.split(load_source("cityscapes").example)
    assert program == "semgrid-eval"
    assert run(*arguments) == 0
    assert [path.relative_to(tmp_path) for path in find_logs(tmp_path)] == [Path("logs/val/aachen_000000_000000.mcap")]
    assert capsys.readouterr().err.endswith("logs: 1 written, 0 up to date, 0 failed\n")


def test_second_run_writes_nothing(tree, tmp_path, capsys):
    tree.write(range(2))
    arguments = ("convert", "cityscapes", tree.root, tmp_path / "logs", "--workers", 1)
    assert run(*arguments) == 0
    assert run(*arguments) == 0
    assert "logs: 0 written, 1 up to date, 0 failed\n" in capsys.readouterr().err


def test_frames_without_labels_are_counted_and_how_to_label_them_is_told(tree, tmp_path, capsys):
    tree.gt_fine = True
    tree.write(range(30))
    broken = Tree(tree.root, city="bonn")
    broken.disparity(broken.write(range(2))[1]).unlink()  # what fails does not count
    assert run("convert", "cityscapes", tree.root, tmp_path / "logs") == 1
    command = f"semgrid-eval segment {tmp_path / 'logs'} --model NETWORK.onnx --out LABELLED"
    assert capsys.readouterr().err.endswith(f"29 of 30 frames have no labels: add them with {command}\n")


def test_faulty_sequences_are_named_and_the_rest_is_converted(tree, tmp_path, capsys):
    Tree(tree.root, city="bonn").write(range(2))
    names = tree.write(range(3))
    tree.disparity(names[1]).unlink()
    assert run("convert", "cityscapes", tree.root, tmp_path / "logs") == 1
    assert [path.stem for path in find_logs(tmp_path / "logs")] == ["bonn_000000_000000"]
    said = capsys.readouterr()
    assert f"Error: val/aachen_000000_000000: {tree.disparity(names[1])}: is missing\n" in said.err
    assert said.out == ""


def test_options_reach_the_log(tree, tmp_path):
    labelled(tree, tmp_path / "labels", kind="LabelTrainIds", highest=18)
    options = ("--labels", tmp_path / "labels", "--train-ids", "--camera-name", "left", "--split", "val")
    assert run("convert", "cityscapes", tree.root, tmp_path / "logs", *options) == 0
    (path,) = find_logs(tmp_path / "logs")
    with LogReader(path) as log:
        assert log.scene.cameras == ("left",)
        assert all(frame.label_png is not None for frame in log.frames("left"))


def test_logs_of_an_earlier_conversion_are_a_warning_in_the_splits_converted_now(tree, tmp_path, capsys):
    logs = tmp_path / "logs"
    other = Tree(tmp_path / "other", city="bonn")
    tree.write(range(2))
    other.write(range(2))
    Tree(other.root, split="train").write(range(2))
    for source, split in ((tree, "val"), (other, "train")):
        assert run("convert", "cityscapes", source.root, logs, "--split", split) == 0
        assert "Warning" not in capsys.readouterr().err
    assert run("convert", "cityscapes", other.root, logs, "--split", "val") == 0
    stray = logs / "val" / "aachen_000000_000000.mcap"
    *_, last, _ = capsys.readouterr().err.splitlines()
    assert last == f"Warning: {logs} holds 1 log beside those of this conversion, such as {stray}"


def test_when_every_recording_fails_there_is_no_other_error(tree, tmp_path, capsys):
    (name,) = tree.write([0])
    tree.disparity(name).unlink()
    assert run("convert", "cityscapes", tree.root, tmp_path / "logs") == 1
    assert capsys.readouterr().err.endswith("logs: 0 written, 0 up to date, 1 failed\n")


def test_labels_of_the_other_kind_are_one_line_without_traceback(tree, tmp_path, capsys):
    labelled(tree, tmp_path / "labels", kind="LabelTrainIds", highest=18)
    assert run("convert", "cityscapes", tree.root, tmp_path / "logs", "--labels", tmp_path / "labels") == 1
    first = tmp_path / "labels" / "aachen_000000_000000_predLabelTrainIds.png"
    assert capsys.readouterr().err == f"Error: {first}: is named as train ids; add --train-ids\n"
    assert not (tmp_path / "logs").exists()


def test_wrong_folder_is_one_line_without_traceback(tmp_path, capsys):
    assert run("convert", "cityscapes", tmp_path, tmp_path / "logs") == 1
    said = capsys.readouterr().err
    assert said == f"Error: {tmp_path}/leftImg8bit_sequence: is not a folder; a Cityscapes sequence tree has one\n"


def test_help_works_though_the_synthetic_extra_is_missing(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "semgrid_eval.sources.town.convert", None)
    assert run("convert", "--help") == 0
    assert run("convert", "synthetic", "--help") == 0
    assert "--town-size-m" in capsys.readouterr().out
    assert run("convert", "synthetic", "logs", "--recordings", 3) == 1
    assert "run: pip install 'semgrid-eval[synthetic]'" in capsys.readouterr().err


def test_sources_are_listed():
    assert command.list_commands(None) == [
        "cityscapes",
        "synthetic",
        "argoverse2",
        "kitti",
        "ros2",
        "town-v1",
        "town-rig-v1",
    ]


@pytest.mark.skipif(
    "SEMGRID_REAL_DATA" not in os.environ, reason="SEMGRID_REAL_DATA names no folder of real recordings"
)
def test_real_recordings_are_converted_without_a_finding(tmp_path):
    source = Path(os.environ["SEMGRID_REAL_DATA"])
    labels = source / "pred_sequence"
    assert run("convert", "cityscapes", source, tmp_path, "--labels", labels) == 0
    paths = find_logs(tmp_path)
    images = list((source / "leftImg8bit_sequence").glob("*/*/*_leftImg8bit.png"))
    total = 0
    for path in paths:
        assert check_log(path).findings == ()
        with LogReader(path) as log:
            frames = list(log.frames("front", images=True))
            total += len(frames)
            assert len(log.motion()) == len(frames)
            assert all(frame.label_png is not None for frame in frames)
            first = source / "leftImg8bit_sequence" / log.scene.split
            assert frames[0].image_file == next(first.glob(f"*/{log.scene.name}_leftImg8bit.png")).read_bytes()
    assert total == len(images)
