"""The test of the house: what is new is one file and one line in a table, and the floors above find it.

A source, a kind of sensor, a disturbance, a baseline, a trained network with a loss of its own, a metric and a region
of cells are added here, each in a file of its own; the commands then convert, run and report them.
"""

import importlib
import json
import sys

import pandas as pd
import pytest
import yaml
from click.testing import CliRunner

from semgrid_eval.cli.main import cli
from semgrid_eval.models.registry import MODELS
from semgrid_eval.scores.metrics.table import METRICS
from semgrid_eval.scores.regions.table import PARTITIONS
from semgrid_eval.sensors.kinds import KINDS
from semgrid_eval.sources.known import SOURCES, Known
from semgrid_eval.windows.disturb.kinds import KINDS as DISTURBANCES

FILES = {
    "seam_source": """
from typing import Annotated

from pydantic import Field
from support.toy_world import street

from semgrid_eval.config import Config
from semgrid_eval.log.convert import convert_recordings
from semgrid_eval.sources.known import Source


class Options(Config):
    speed_mps: Annotated[float, Field(description="Of the vehicle.")] = 8.0


def recordings(options):
    for number, split in enumerate(("train", "train", "val", "val")):
        world = street(number, frames=9, speed_mps=options.speed_mps + number, noise_px=0.05)
        yield world.recording(f"lane{number}", split)


SOURCE = Source(
    Options,
    lambda options, out, work: convert_recordings(recordings(options), out, work),
    help="Drive down a lane.",
    example="semgrid-eval convert lane logs",
)
""",
    "seam_sensor": '''
from typing import Literal

import numpy as np

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.sensors.sensor import Kind, Points, SensorConfig


class Kerb(SensorConfig):
    """Sees the sidewalk at one distance to the left, 10 ms before each frame of the camera."""

    kind: Literal["kerb"] = "kerb"
    left_m: float = 6.0


def read(log, sensors, class_by_label):
    for frame in log.frames(log.choose_camera(None)):
        for name, sensor in sensors.items():
            ahead_m = np.arange(1.0, 60.0, 0.25)
            classes = np.full(len(ahead_m), CLASS_NAMES.index("sidewalk"), np.uint8)
            yield Points(name, frame.stamp_ns - 10_000_000, ahead_m, np.full(len(ahead_m), sensor.left_m), classes)


KIND = Kind(Kerb, read)
''',
    "seam_disturbance": """
from dataclasses import replace
from typing import Literal

from semgrid_eval.windows.disturb.disturbance import Disturbance


class Fog(Disturbance):
    kind: Literal["fog"] = "fog"
    strength: int = 96

    @property
    def words(self):
        return f"nothing seen in {self.strength} rows"

    def apply(self, inputs):
        grids = inputs.grids.clone()
        grids[..., : self.strength, :] = 0
        return replace(inputs, grids=grids)
""",
    "seam_baseline": """
from semgrid_eval import Baseline, one_hot


class Oldest(Baseline):
    words = "oldest input"

    def predict(self, batch):
        return one_hot(batch.past[:, 0, 0])
""",
    "seam_network": """
import torch

from semgrid_eval import Network, NetworkSettings, input_planes


class Tiny(Network):
    words = "a tiny network"
    family = "Tiny"

    class Settings(NetworkSettings):
        width: int = 4
        weight: float = 1.0

    def __init__(self, settings, given):
        super().__init__(settings, given)
        self.first = torch.nn.Conv2d(given.planes, settings.width, 3, padding=1)
        self.last = torch.nn.Conv2d(settings.width, 10, 1)

    def forward(self, batch):
        return self.last(self.first(input_planes(batch.past)).relu())

    def loss(self, logits, batch):
        kept = (~batch.mask)[:, None]
        right = torch.nn.functional.one_hot(batch.target.long(), 10).permute(0, 3, 1, 2)
        return self.settings.weight * ((logits.softmax(dim=1) - right) ** 2 * kept).mean()
""",
    "seam_metric": """
import numpy as np

from semgrid_eval.classes import UNKNOWN
from semgrid_eval.scores.metrics.metric import Column, divided


class Coverage:
    name = "coverage"
    title = "Share of cells that are predicted to be known"
    shape = (2,)
    ratio_names = ("known",)
    columns = (Column("known", "Known"),)
    shown = ("known",)

    def count(self, scored, regions):
        return regions.tally((scored.prediction != UNKNOWN).astype(np.int64), 2)

    def ratios(self, sums):
        return np.stack([sums[..., 1], sums.sum(axis=-1)], axis=-1)[..., None, :]

    def figures(self, ratios):
        return divided(ratios[..., 0], ratios[..., 1])

    def cells(self, sums):
        return np.asarray(sums.sum(axis=-1, keepdims=True))
""",
    "seam_region": """
import numpy as np

from semgrid_eval.scores.metrics.metric import Partition


def sides(scored):
    columns = np.arange(scored.target.shape[2]) >= scored.target.shape[2] // 2
    return np.broadcast_to(columns.astype(np.int64), scored.target.shape)


SIDES = Partition("sides", ("left", "right"), "by the side of the road", sides)
""",
}

TRAINING = {"epochs": 2, "updates_per_epoch": 3, "batch": 2}
MATRIX = {
    "seed": 3,
    "defaults": {
        "window": {"step_frames": 3, "target_frame": 8},
        "grid": {"sensors": {"full": {}, "kerb": {"kind": "kerb", "left_m": 6.5}}},
    },
    "models": {"tiny": {"training": TRAINING}},
    "rows": [
        {"name": "newest", "model": "newest"},
        {"name": "oldest", "model": "oldest"},
        {"name": "kerb", "model": "fuse", "sensors": ["full", "kerb"]},
        {"name": "fog", "model": "newest", "disturb": {"kind": "fog"}},
        {"name": "tiny-w{settings.width}", "model": "tiny", "axes": {"grid": {"settings.width": [2, 4]}}},
    ],
}


@pytest.fixture
def added(tmp_path, monkeypatch):
    """Write each file and put its line into its table."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.setitem(SOURCES, "lane", Known("seam_source:SOURCE", "Lanes."))
    monkeypatch.setitem(KINDS, "kerb", importlib.import_module("seam_sensor").KIND)
    monkeypatch.setitem(DISTURBANCES, "fog", importlib.import_module("seam_disturbance").Fog)
    monkeypatch.setitem(MODELS, "oldest", "seam_baseline:Oldest")
    monkeypatch.setitem(MODELS, "tiny", "seam_network:Tiny")
    monkeypatch.setitem(METRICS, "coverage", importlib.import_module("seam_metric").Coverage())
    monkeypatch.setitem(PARTITIONS, "sides", importlib.import_module("seam_region").SIDES)
    yield tmp_path
    for name in FILES:
        sys.modules.pop(name, None)


def command(*arguments):
    done = CliRunner().invoke(cli, [str(argument) for argument in arguments], standalone_mode=False)
    if done.exception is not None:
        raise done.exception
    assert not done.return_value, done.output


@pytest.mark.slow
def test_what_is_added_in_one_file_each_stands_in_a_finished_report(added):
    (added / "m.yaml").write_text(yaml.safe_dump(MATRIX))
    command("convert", "lane", "logs", "--workers", 1, "--speed-mps", "7")
    command("run", "m.yaml", "--logs", "logs", "--out", "out", "--device", "cpu", "--no-pictures", "--workers", 1)
    command("report", "out")
    record = json.loads((added / "out" / "run.json").read_text())
    assert {log["dataset"] for log in record["logs"]} == {"toy"}
    rows = {row["name"]: row for row in record["rows"]}
    assert {name: row["failure"] for name, row in rows.items()} == dict.fromkeys(
        ("newest", "oldest", "kerb", "fog", "tiny-w2", "tiny-w4")
    )
    assert rows["kerb"]["facts"]["sensors"] == ["full", "kerb"]
    assert (rows["oldest"]["facts"]["baseline"], rows["tiny-w2"]["facts"]["learns"]) == (True, True)

    summary = pd.read_csv(added / "out" / "report" / "summary.csv")
    everywhere = summary[(summary.division == "all") & (summary.region == "all")].set_index(["row", "metric", "column"])
    known = {name: everywhere.loc[(name, "coverage", "known")].value for name in rows}
    assert known["kerb"] > known["newest"] > 0.0  # the kerb fills cells that no camera saw
    assert known["newest"] > known["fog"] > 0.0
    mean = {name: everywhere.loc[(name, "iou", "mean_known")].value for name in rows}
    assert mean["newest"] != mean["oldest"]
    assert everywhere.loc[("tiny-w2", "iou", "mean_known")].reference == "newest"
    kerb = summary[(summary.division == "sides") & (summary.metric == "coverage") & (summary.row == "kerb")]
    left, right = (kerb[kerb.region == side].value.item() for side in ("left", "right"))
    assert min(left, right) < known["kerb"] < max(left, right)
    page = (added / "out" / "report" / "index.html").read_text()
    for text in (
        "Share of cells that are predicted to be known",
        "by the side of the road",
        "tiny-w4",
        "a tiny network",
        "nothing seen in 96 rows",
    ):
        assert text in page


@pytest.mark.slow
def test_a_network_of_ones_own_is_trained_with_its_own_loss(added):
    (added / "m.yaml").write_text(yaml.safe_dump(MATRIX))
    command("convert", "lane", "logs", "--workers", 1)
    losses = []
    for weight in (1.0, 2.0):
        (added / "n.yaml").write_text(
            yaml.safe_dump({"extends": "m.yaml", "models": {"tiny": {"weight": weight}}, "without": ["kerb", "oldest"]})
        )
        out = ("--out", f"out{weight}", "--device", "cpu", "--no-pictures", "--workers", 1)
        command("run", "n.yaml", "--logs", "logs", *out)
        command("report", f"out{weight}")
        history = pd.read_csv(added / f"out{weight}" / "report" / "training.csv")
        losses.append(history[(history.row == "tiny-w2") & (history.epoch == 1)].loss.item())
    assert losses[1] == pytest.approx(2 * losses[0], rel=0.1)
