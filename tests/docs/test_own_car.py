"""What docs/own-car.md shows is run on a small bag, step by step, and its maps are read."""

import re
import shlex

import numpy as np
import pytest
import yaml
from support.bags import RecordingBag, Sent, Variant, write_bag
from support.commands import run_command
from support.onnx_models import toy_labeller
from support.pages import blocks, commands, text_of
from support.rig_bags import lidar_link
from support.ros_messages import cloud
from support.swept import seen
from support.toy_world import START_NS, street

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
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
    write_bag(tmp_path / "drive", with_lidar(street(1, frames=16, noise_px=0.05)))
    toy_labeller(tmp_path / "network.onnx")
    (tmp_path / "m.yaml").write_text(YAML[2])
    (tmp_path / "single.yaml").write_text(YAML[3])
    (tmp_path / "both.yaml").write_text(YAML[4])
    return tmp_path


def with_lidar(world):
    """The messages of a camera, and of a LiDAR without labels whose points have times."""
    messages = list(RecordingBag(world.recording(), Variant(labels="")).messages())
    ahead = [(x + 0.5, y + 0.5) for x in range(6, 30) for y in range(-5, 5)]
    for each in [each for each in messages if each.topic == "/odom"]:
        stamp = each.message.header.stamp
        stamp_ns = stamp.sec * 10**9 + stamp.nanosec
        sweep = seen(stamp_ns, world.pose_at(stamp_ns - START_NS), ahead)
        points = np.zeros(len(ahead), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("time", "f4")])
        points["x"], points["y"], points["z"] = sweep.points_m.T
        points["z"] -= 0.9  # on the ground, nearly
        points["time"] = np.linspace(-0.05, 0.0, len(ahead))
        messages.append(Sent("/velodyne_points", each.received_ns, cloud(stamp_ns, points, frame="velodyne")))
    messages.append(Sent("/tf_static", messages[0].received_ns, lidar_link("velodyne", sweep)))
    return sorted(messages, key=lambda sent: sent.received_ns)


def run(line):
    program, *arguments = shlex.split(line)
    assert program == "semgrid-eval"
    ended = run_command(arguments)
    assert ended.code == 0, f"{line}\n{ended.err}"
    return ended.out + ended.err


@pytest.mark.slow
def test_every_command_of_the_page_runs_in_its_order(workplace):
    assert [line.split()[1] for line in COMMANDS] == [
        "convert",
        "convert",
        "check",
        "segment",
        "run",
        "report",
        "run",
        "report",
        "grids",
    ]
    said = [run(line) for line in COMMANDS]
    assert "/stereo/left/image_rect_color" in said[0]
    assert "x, y, z, time float32" in said[0]
    assert "32 of 32 frames and sweeps" in said[1]
    assert "points of top have no labels: a grid needs `label_field` in the map, or a camera to colour them" in said[1]
    assert "add them with semgrid-eval segment logs --model NETWORK.onnx --out LABELLED" in said[1]
    (log,) = find_logs(workplace / "labelled")
    with LogReader(log) as reader:
        assert all(frame.label_png for frame in reader.frames("front"))
    for name in ("drive", "points"):
        assert all(row.results for row in read_run(workplace / "runs" / name).rows)
        assert (workplace / "runs" / name / "report" / "index.html").is_file()
    assert len(list((workplace / "grids").glob("*.npz"))) == 1
    assert_points_are_coloured(log)


def assert_points_are_coloured(log):
    (grids,) = build_log(log, parse_config(GridConfig, yaml.safe_load(YAML[4])))
    assert grids.sensors == ("front", "top", "front+top")
    assert (grids.grids[1] != UNKNOWN).any(axis=(1, 2)).all()


def test_the_short_map_of_the_page_converts_the_bag(workplace):
    (workplace / "short.yaml").write_text(YAML[0])
    assert "16 of 16 frames" in run("semgrid-eval convert ros2 drive logs --map short.yaml --workers 1")


def test_the_long_map_of_the_page_is_one(workplace):
    (workplace / "long.yaml").write_text(YAML[1])
    found = load_map(workplace / "long.yaml")
    assert (list(found.cameras), list(found.lidars)) == (["front", "rear", "side"], ["top"])
    assert found.single == {"side"}


def test_what_the_page_says_is_refused_is_what_bad_bags_end_with():
    """docs/bad-inputs.md holds the lines that commands print; three dots stand for anything."""
    printed = "\n".join(told(text_of("docs/bad-inputs.md")))
    shown = told(PAGE[PAGE.index("## What is refused") :])
    assert len(shown) == 16
    for line in shown:
        expected = ".+".join(re.escape(part) for part in line.split("..."))
        assert re.search(rf"^val/drive(_000000)?: drive: {expected}$", printed, re.MULTILINE), line


def told(page):
    """The lines of tables of what is wrong."""
    return [line.strip() for _, line in re.findall(r"^\| [^|]+ \| (`+)(.+?)\1 \|$", page, re.MULTILINE)]
