"""What docs/lidar.md shows is run on small data, and its tables are those of the code."""

import re
import shlex
from html import unescape
from pathlib import Path

import pytest
import yaml
from support.commands import run_command
from support.kitti_tree import Sequence
from support.pages import blocks, commands, text_of

from semgrid_eval.config import parse_config
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.scores.results import read_run
from semgrid_eval.sensors.lidar import ColourFrom
from semgrid_eval.sources.argoverse2.categories import CATEGORIES
from semgrid_eval.sources.kitti.labels import CLASSES

PAGE = text_of("docs/lidar.md")
LIDAR, TRACKS = "logs", "drives"
RING_CAMERAS = ("ring_front_center", "ring_side_left", "ring_side_right")
COMMANDS = [line for line in commands(PAGE) if line.startswith("semgrid-eval ")]
MATRICES = [block for block in blocks("yaml", PAGE) if "\nrows:" in block]


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in zip(("lidar.yaml", "tracks.yaml"), MATRICES, strict=True):
        Path(name).write_text(text)
    return tmp_path


def run(folder):
    """Run the commands that work on a folder of logs, in their order."""
    about = {folder, "runs/lidar" if folder == LIDAR else "runs/tracks"}
    for line in COMMANDS:
        _, *words = shlex.split(line)
        if about & set(words):
            ended = run_command(words)
            assert ended.code == 0, f"{line}\n{ended.err}"


@pytest.mark.slow
def test_commands_for_kitti(workplace):
    ground = tuple((float(x), float(y), -1.6) for x in range(4, 40) for y in range(-6, 7))
    for name in ("05", "07"):
        Sequence(frames=8, points=ground, labels=(40,) * len(ground)).write(workplace / "SRC", name)
    run(LIDAR)
    rows = read_run(Path("runs/lidar")).rows
    assert {row.name: row.failure for row in rows} == dict.fromkeys(("BL-NT", "BL-DC", "BL-Fuse"))
    offered = re.findall(r"semgrid-eval (play [^<]+)<", Path("runs/lidar/report/index.html").read_text())
    assert offered
    words = shlex.split(unescape(offered[0]).replace("RUN", "runs/lidar").replace("LOGS", LIDAR))
    assert run_command(words).code == 0


@pytest.mark.slow
def test_commands_for_argoverse(workplace):
    pytest.importorskip("pyarrow", reason="the extra `argoverse` is not installed")
    pytest.importorskip("onnxruntime", reason="the extra `segment` is not installed")
    pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")
    from support.argoverse_log import write_argoverse
    from support.onnx_models import colour_network

    write_argoverse(workplace / "SRC", frames=14, stereo=True, ring=True)
    colour_network(Path("network.onnx"), colours={0: (0.5, 0.5, 0.5), 11: (1.0, 0.0, 0.0)})
    Path("tracks.yaml").write_text(MATRICES[1].replace("[1, 2, 3]", "[3]"))
    run(TRACKS)
    with LogReader(Path("labelled/val/drive.mcap")) as labelled:
        assert labelled.scene.cameras == ("ring_front_center", "ring_rear_left", "stereo_front_left")
        for camera in labelled.scene.cameras:
            assert all(frame.label_png for frame in labelled.frames(camera))
    exec(blocks("python", PAGE)[0], {})
    assert [path.name for path in Path("wrong/val").iterdir()] == ["drive.mcap"]
    rows = read_run(Path("runs/tracks")).rows
    assert {row.name: row.failure for row in rows} == dict.fromkeys(("BL-NT-3", "BL-DC-3", "BL-Flow-3", "RN-town-3"))


def test_other_settings_of_the_page_are_valid():
    others = [yaml.safe_load(each)["grid"] for each in blocks("yaml", PAGE) if "\nrows:" not in each]
    both, coloured, ring = (parse_config(GridConfig, each) for each in others)
    assert both.target_row == "top+left"
    assert coloured.sensors["top"].colour_from == ColourFrom(camera="left", within_s=0.1, occlusion_rad=0.0057)
    assert ring.sensors["top"].colour_from == ColourFrom(camera=RING_CAMERAS, occlusion_rad=0.01)


@pytest.mark.parametrize(
    ("title", "known"),
    [("SemanticKITTI", dict(CLASSES.values())), ("Argoverse", CATEGORIES)],
)
def test_the_maps_of_labels_are_those_of_the_code(title, known):
    table = PAGE.split(f"| {title} | Cityscapes |\n|---|---|\n")[1].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    assert {name.strip(): label for names, label in rows for name in names.split(",")} == known
