"""A bag of two single cameras and a LiDAR without labels, from the bag to a report."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from support.bags import write_bag
from support.commands import run_command
from support.rig_bags import Coding, RigBag
from support.single import single_rig
from support.toy_world import START_NS
from support.unlabelled import unlabelled

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, write_log
from semgrid_eval.scores.results import read_run

COLOURED = {
    "spec": {"agent_row": 96},
    "sensors": {"top": {"kind": "lidar", "colour_from": {"camera": ["left", "right"]}}},
    "target": ["top"],
}
OWN = {**COLOURED, "sensors": {"top": {"kind": "lidar"}}, "target": ["top"]}
MATRIX = {
    "defaults": {"window": {"step_frames": 2, "target_frame": None}, "grid": {**COLOURED, "stretch_frames": 100}},
    "rows": [{"name": "BL-NT", "model": "newest", "translate": False}, {"name": "BL-DC", "model": "newest"}],
}


def ran(line):
    ended = run_command(line.split())
    assert ended.code == 0, f"{line}\n{ended.err}"
    return ended.err


@pytest.fixture
def bag(tmp_path, monkeypatch):
    """A bag with labels of the cameras' pixels, and its map."""
    monkeypatch.chdir(tmp_path)
    made = RigBag(single_rig(), Coding(labels=""))
    made.write(tmp_path / "drive")
    (tmp_path / "map.yaml").write_text(made.map_text())
    return made


def test_a_bag_with_labels_becomes_a_log_that_is_good_and_says_what_has_no_depth(bag):
    said = ran("convert ros2 drive logs --workers 1")
    worth = "labels of theirs can colour the points of a LiDAR: `colour_from` of the sensor"
    assert f"nothing tells the depth of left, right; {worth}" in said
    (log,) = find_logs(Path("logs"))
    assert check_log(log).findings == ()
    assert ran("check logs --strict")
    with LogReader(log) as reader:
        assert [reader.is_single(name) for name in ("left", "right")] == [True, True]
        assert [len(list(reader.frames(name))) for name in ("left", "right")] == [16, 16]
        assert [each.label_id for each in reader.sweeps("top")] == [None] * 8


def test_coloured_points_have_the_classes_of_what_they_hit(bag, tmp_path):
    """Both cameras see all that the LiDAR sees, half a frame earlier or later at most."""
    ran("convert ros2 drive logs --workers 1")
    write_log(single_rig(labelled=True), tmp_path / "own.mcap")
    (coloured,) = build_log(find_logs(Path("logs"))[0], parse_config(GridConfig, COLOURED))
    (own,) = build_log(tmp_path / "own.mcap", parse_config(GridConfig, OWN))
    known = (coloured.grids[0] != UNKNOWN) & (own.grids[0] != UNKNOWN)
    assert known.sum() > 0.7 * (own.grids[0] != UNKNOWN).sum()
    assert (coloured.grids == own.grids)[0][known].mean() > 0.98
    for side in (np.s_[..., :60], np.s_[..., 68:]):
        assert known[side].sum() > 0.3 * known.sum(), "both cameras do their part"


def test_the_drafted_map_the_network_and_baselines_lead_to_a_report_with_pictures(tmp_path, monkeypatch):
    pytest.importorskip("onnxruntime", reason="the extra `segment` is not installed")
    pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")
    from support.onnx_models import toy_labeller

    monkeypatch.chdir(tmp_path)
    RigBag(unlabelled(single_rig()), Coding(labels="")).write(tmp_path / "drive")
    toy_labeller(tmp_path / "network.onnx")
    Path("m.yaml").write_text(yaml.safe_dump(MATRIX))
    ran("convert ros2 drive --inspect")
    for line in (
        "convert ros2 drive logs --workers 1",
        "segment logs --model network.onnx --out labelled --workers 1",
        "check labelled --strict",
        "run m.yaml --logs labelled --out run --device cpu --workers 1",
        "report run",
        "play run BL-DC --logs labelled --out run.mcap",
    ):
        ran(line)
    rows = read_run(Path("run")).rows
    assert {row.name: row.failure for row in rows} == {"BL-NT": None, "BL-DC": None}
    page = Path("run/report/index.html").read_text()
    assert "data:image/webp" in page, "images of a camera"


def test_images_that_are_missing_end_no_recording(bag):
    """The left camera loses every image of a fifth of a second; the LiDAR's sweeps stay together."""
    messages = [
        each
        for each in bag.messages()
        if not (each.topic == "/left/image" and 0 < each.received_ns - START_NS - 400_000_000 < 200_000_000)
    ]
    write_bag(Path("holes"), messages)
    ran("convert ros2 holes logs --workers 1")
    (log,) = find_logs(Path("logs"))
    with LogReader(log) as reader:
        assert len(list(reader.sweeps("top"))) == 8
        assert len(list(reader.frames("left"))) == 12


@pytest.mark.parametrize(("first_ms", "last_ms"), [(600, 10_000), (0, 300)])
def test_a_recording_in_which_a_camera_has_no_frame_is_one_without_that_camera(bag, first_ms, last_ms):
    """The left camera starts late, or dies; the LiDAR loses no sweep."""
    messages = [
        each
        for each in bag.messages()
        if each.topic != "/left/image" or first_ms <= (each.received_ns - START_NS) * 1e-6 <= last_ms
    ]
    write_bag(Path("part"), messages)
    said = ran("convert ros2 part logs --workers 1 --recording-s 0.5")
    logs = find_logs(Path("logs"))
    assert "left has no frame in 1 of 2 recordings" in said
    assert sum(len(sweeps_of(log)) for log in logs) == 8
    assert sorted(cameras_of(log) for log in logs) == [("left", "right"), ("right",)]
    assert [check_log(log).findings for log in logs] == [(), ()]


def sweeps_of(log):
    with LogReader(log) as reader:
        return list(reader.sweeps("top"))


def cameras_of(log):
    with LogReader(log) as reader:
        return reader.scene.cameras
