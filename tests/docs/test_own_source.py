"""What docs/own-source.md shows is run from its first file to the report."""

import io
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.commands import run_command
from support.pages import blocks, commands, text_of

import semgrid_eval as sg
from semgrid_eval.scores.results import read_run

PAGE = text_of("docs/own-source.md")
CONVERT, CAMERA = blocks("python", PAGE)
HZ, FRAMES = 10, 16


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """A folder with a drive straight on, over a road with a wall beside it, past a car."""
    monkeypatch.chdir(tmp_path)
    Path("drives").mkdir()
    Path("convert_mine.py").write_text(CONVERT)
    Path("mine.yaml").write_text(blocks("yaml", PAGE)[0])
    road = [(x, y, 0.0, 1) for x in np.arange(3, 45, 0.7) for y in np.arange(-5, 5, 0.7)]
    wall = [(x, -8.0, 1.0, 4) for x in np.arange(3, 45, 0.7)]
    car = [(x, y, 0.8, 2) for x in np.arange(20, 24, 0.4) for y in np.arange(2, 4, 0.4)]
    world = np.array([*road, *wall, *car])
    seen = [world - (5.0 * k / HZ + 1.2, 0.0, 1.9, 0) for k in range(FRAMES)]
    stamps_ns = 10**18 + np.arange(FRAMES) * 10**9 // HZ
    straight = {"speed": np.full(FRAMES, 5.0), "yaw_rate": np.zeros(FRAMES)}
    classes = np.array([each[:, 3] for each in seen]).astype(np.uint8)
    points = np.array([each[:, :3] for each in seen])
    np.savez("drives/first.npz", stamps_ns=stamps_ns, points=points, classes=classes, **straight)
    return tmp_path


@pytest.mark.slow
def test_every_command_of_the_page_runs_in_its_order(workplace):
    program, *others = commands(PAGE)
    made = subprocess.run([sys.executable, *program.split()[1:]], capture_output=True, text=True, check=True)
    assert made.stdout.split() == ["logs/val/first.mcap", "is", "good"]
    for line in others:
        ended = run_command(shlex.split(line)[1:])
        assert ended.code == 0, f"{line}\n{ended.err}"
    assert {row.name: row.failure for row in read_run(Path("runs/mine")).rows} == {"BL-NT": None, "BL-DC": None}
    assert Path("runs/mine/report/index.html").is_file()


def test_points_lie_where_they_were_and_the_class_is_theirs(workplace):
    exec(CONVERT, {})
    config = sg.GridConfig(sensors={"roof": {"kind": "lidar"}}, target=("roof",))
    (grids,) = sg.build_grids(workplace / "logs/val/first.mcap", config)
    first = grids.grids[0, 0]
    spec = config.spec

    def at(ahead_m, left_m):
        forward_m, sideways_m = spec.centres_m()
        return sg.CLASS_NAMES[first[np.abs(forward_m - ahead_m).argmin(), np.abs(sideways_m - left_m).argmin()]]

    assert (at(22.0, 3.0), at(10.0, 0.0), at(60.0, 0.0)) == ("car", "road", "unknown")
    assert (grids.dataset, grids.group, grids.split) == ("mine", "a town", "val")


def test_a_frame_with_depth_becomes_a_camera(tmp_path):
    shown = {}
    exec(CAMERA, shown)
    depth_m = np.full((128, 256), 20.0, np.float32)
    depth_m[:30] = 0.0
    picture = io.BytesIO()
    Image.new("RGB", (256, 128)).save(picture, "JPEG")
    stamps_ns = range(10**18, 10**18 + 3 * 10**8, 10**8)

    def moments():
        for stamp_ns in stamps_ns:
            frame = shown["frame"](stamp_ns, picture.getvalue(), depth_m)
            yield sg.Moment(stamp_ns, {"front": frame}, (sg.MotionSample(stamp_ns, 5.0, 0.0),))

    recording = sg.Recording("a", "mine", "val", {"front": shown["CALIBRATION"]}, "0", moments)
    sg.write_log(recording, tmp_path / "val/a.mcap")
    found = [str(each) for each in sg.check_log(tmp_path / "val/a.mcap").findings]
    told = "/camera/front/label: missing_beside: is missing (`semgrid-eval segment` adds it) for 3 of 3 messages"
    assert len(found) == 1
    assert told in found[0]
