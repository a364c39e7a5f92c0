"""What docs/own-car.md shows is run on a small bag, step by step, and its maps are read."""

import re
import shlex
from pathlib import Path

import pytest
from support.bags import RecordingBag, Variant
from support.commands import run_command
from support.onnx_models import toy_labeller
from support.pages import blocks, commands, text_of
from support.toy_world import street

from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.scores.results import read_run
from semgrid_eval.sources.ros2.mapping import load_map

PAGE = text_of("docs/own-car.md")
YAML = blocks("yaml", PAGE)
COMMANDS = [line for line in commands(PAGE) if line.startswith("semgrid-eval ")]


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    world = street(1, frames=16, noise_px=0.05)
    RecordingBag(world.recording(), Variant(labels="")).write(tmp_path / "drive")
    toy_labeller(tmp_path / "network.onnx")
    (tmp_path / "m.yaml").write_text(YAML[2])
    return tmp_path


def run(line):
    program, *arguments = shlex.split(line)
    assert program == "semgrid-eval"
    ended = run_command(arguments)
    assert ended.code == 0, f"{line}\n{ended.err}"
    return ended.out + ended.err


@pytest.mark.slow
def test_every_command_of_the_page_runs_in_its_order(workplace):
    assert [line.split()[1] for line in COMMANDS] == ["convert", "convert", "check", "segment", "run", "report"]
    said = [run(line) for line in COMMANDS]
    assert "/stereo/left/image_rect_color" in said[0]
    assert "16 of 16 frames" in said[1]
    assert "add them with semgrid-eval segment logs --model NETWORK.onnx --out LABELLED" in said[1]
    (log,) = find_logs(workplace / "labelled")
    with LogReader(log) as reader:
        assert all(frame.label_png for frame in reader.frames("front"))
    assert all(row.results for row in read_run(workplace / "runs/drive").rows)
    assert (workplace / "runs/drive/report/index.html").is_file()


def test_the_short_map_of_the_page_converts_the_bag(workplace):
    (workplace / "short.yaml").write_text(YAML[0])
    assert "16 of 16 frames" in run("semgrid-eval convert ros2 drive logs --map short.yaml --workers 1")


def test_the_long_map_of_the_page_is_one(workplace):
    (workplace / "long.yaml").write_text(YAML[1])
    assert list(load_map(workplace / "long.yaml").cameras) == ["front", "rear"]


def test_what_the_page_says_is_refused_is_what_the_tests_of_bags_expect():
    here = Path(__file__).parents[1] / "sources" / "ros2"
    tested = "".join((here / f"test_{name}.py").read_text(encoding="utf-8") for name in ("faults", "damage"))
    shown = re.findall(r"^\| [^|]+ \| `+(.+?)`+ \|$", PAGE[PAGE.index("## What is refused") :], re.MULTILINE)
    assert len(shown) == 11
    for line in shown:
        words = max(re.findall(r"[A-Za-z][A-Za-z ]+[A-Za-z]", line), key=len)
        assert words in tested, words
