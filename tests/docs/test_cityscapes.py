"""The chain of docs/cityscapes.md, run on a tree with Cityscapes' own names, made of pictures of a toy world."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="the extra 'segment' is not installed")
pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")

from support.cityscapes_tree import put, put_json
from support.commands import run_command
from support.onnx_models import toy_labeller
from support.pages import commands, text_of
from support.toy_world import street

from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.scores.results import read_run

PAGE = text_of("docs/cityscapes.md")
COMMANDS = [line for line in commands(PAGE) if line.startswith("semgrid-eval ") and " run paper " not in line]
# First frames of recordings as Cityscapes numbers them: 0 in most cities, running on in others; the 20th is annotated.
RECORDINGS = [
    ("train", "zurich", "zurich_000000", 0),
    ("train", "zurich", "zurich_000001", 0),
    ("val", "frankfurt", "frankfurt_000000", 275),
    ("val", "frankfurt", "frankfurt_000000", 557),
]
LAID_OUT = (
    "leftImg8bit_sequence/train/zurich/zurich_000000_000000_leftImg8bit.png",
    "leftImg8bit_sequence/train/zurich/zurich_000000_000029_leftImg8bit.png",
    "disparity_sequence/train/zurich/zurich_000001_000029_disparity.png",
    "vehicle_sequence/val/frankfurt/frankfurt_000000_000275_vehicle.json",
    "timestamp_sequence/val/frankfurt/frankfurt_000000_000304_timestamp.txt",
    "camera/val/frankfurt/frankfurt_000000_000294_camera.json",
    "gtFine/val/frankfurt/frankfurt_000000_000294_gtFine_labelIds.png",
)


def write_recording(root, split, city, sequence, first, seed):
    """Write 30 frames under Cityscapes' names; camera and gtFine are there for the 20th alone."""
    world = street(seed, frames=30, noise_px=0.05)
    calibration = world.calibration()
    intrinsic = {name: getattr(calibration, f"{name}_px") for name in ("fx", "fy", "u0", "v0")}
    place = {"baseline": calibration.baseline_m, **{axis: getattr(calibration, f"{axis}_m") for axis in "xyz"}}
    turn = {name: getattr(calibration, f"{name}_rad") for name in ("roll", "pitch", "yaw")}
    for position, moment in enumerate(world.recording().moments()):
        frame, (motion,) = moment.cameras["front"], moment.motion
        name = f"{split}/{city}/{sequence}_{first + position:06d}"
        put(root / "leftImg8bit_sequence" / f"{name}_leftImg8bit.png", frame.image_file)
        put(root / "disparity_sequence" / f"{name}_disparity.png", frame.disparity_png)
        put(root / "timestamp_sequence" / f"{name}_timestamp.txt", str(moment.stamp_ns).encode())
        told = {"speed": motion.speed_mps, "yawRate": motion.yaw_rate_radps, "gpsHeading": 271.5}
        told |= {"gpsLatitude": 50.1, "gpsLongitude": 8.7, "outsideTemperature": 19.5}
        put_json(root / "vehicle_sequence" / f"{name}_vehicle.json", told)
        if position == 19:
            put_json(root / "camera" / f"{name}_camera.json", {"extrinsic": place | turn, "intrinsic": intrinsic})
            put(root / "gtFine" / f"{name}_gtFine_labelIds.png", frame.label_png)


@pytest.fixture(scope="module")
def cityscapes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cityscapes")
    for seed, recording in enumerate(RECORDINGS):
        write_recording(folder / "cityscapes", *recording, seed)
    toy_labeller(folder / "network.onnx")
    return folder


def labels_of(log):
    with LogReader(log) as reader:
        return [
            None if frame.label_png is None else decode_gray(frame.label_png, bit_depth=8)
            for frame in reader.frames("front")
        ]


def test_files_are_where_the_page_says(cityscapes):
    missing = [name for name in LAID_OUT if not (cityscapes / "cityscapes" / name).is_file()]
    assert missing == []
    shown = set(re.findall(r"^cityscapes/(\w+)/<split>/<city>/<frame>_\S+$", PAGE, re.MULTILINE))
    assert shown == {name.partition("/")[0] for name in LAID_OUT}


@pytest.mark.slow
def test_the_chain_of_the_page_runs_on_its_layout(cityscapes, monkeypatch):
    monkeypatch.chdir(cityscapes)
    said = {}
    for line in COMMANDS:
        ended = run_command(shlex.split(line)[1:])
        assert ended.code == 0, f"{line}\n{ended.err}"
        said[line.split()[1]] = ended.out + ended.err
    assert "116 of 120 frames have no labels: add them with semgrid-eval segment logs" in said["convert"]
    names = ["train/zurich_000000_000000", "train/zurich_000001_000000"]
    names += ["val/frankfurt_000000_000275", "val/frankfurt_000000_000557"]
    for folder in ("logs", "labelled"):
        found = [path.relative_to(folder).with_suffix("").as_posix() for path in find_logs(Path(folder))]
        assert found == names
    exact, made = (
        labels_of("logs/val/frankfurt_000000_000275.mcap"),
        labels_of("labelled/val/frankfurt_000000_000275.mcap"),
    )
    assert [position for position, label in enumerate(exact) if label is not None] == [19]
    assert all(label is not None for label in made)
    assert np.mean(exact[19] == made[19]) > 0.95  # of the network, which knows train ids alone
    rows = read_run(Path("runs/baselines")).rows
    assert {row.failure for row in rows} == {None}
    assert Path("runs/baselines/report/index.html").is_file()
