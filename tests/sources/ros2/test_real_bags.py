"""Bags of real recordings, where a folder of them is named by SEMGRID_REAL_DATA, and of a town's stereo pairs."""

import os
from pathlib import Path

import numpy as np
import pytest
from support.bags import RecordingBag, Variant
from support.town_pairs import matched_drive
from support.towns import small_plans

from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, write_log
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sources.cityscapes.tree import CityscapesOptions, find_sequences
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

REAL = os.environ.get("SEMGRID_REAL_DATA", "")


def converted(here, bag):
    bag.write(here / "drive")
    (here / "map.yaml").write_text(bag.variant.map_text)
    convert_bags(Ros2Options(bag=(here / "drive",), map=str(here / "map.yaml")), here / "logs")
    (log,) = find_logs(here / "logs")
    return log


@pytest.mark.skipif(not Path(REAL, "camera").is_dir(), reason="SEMGRID_REAL_DATA names no Cityscapes tree")
@pytest.mark.parametrize(
    "variant",
    [Variant(), Variant("sqlite3", "jpeg", labels="png", motion="imu"), Variant(depth="32FC1", motion="pose")],
    ids=["disparity", "sqlite3", "depth and poses"],
)
def test_grids_of_a_real_bag_are_those_of_its_tree(tmp_path, variant):
    options = CityscapesOptions(src=Path(REAL), labels=Path(REAL, "pred_sequence"))
    recording = next(each for each in find_sequences(options) if each.city == "kitti05").recording()
    write_log(recording, tmp_path / "tree.mcap")
    logs = (tmp_path / "tree.mcap", converted(tmp_path, RecordingBag(recording, variant)))
    expected, found = (build_log(log, GridConfig())[0].grids for log in logs)
    assert (expected > 0).mean() > 0.05
    assert np.array_equal(found, expected)


def test_the_pair_of_a_town_is_matched_as_the_town_matched_it(tmp_path):
    plan = small_plans(stereo="matched", width=256, height=128, frames=4)[0]
    recording, bag = matched_drive(plan)
    write_log(recording, tmp_path / "town.mcap")
    logs = (tmp_path / "town.mcap", converted(tmp_path, bag))
    pictures = []
    for log in logs:
        with LogReader(log) as reader:
            (camera,) = reader.scene.cameras
            frames = list(reader.frames(camera))
        pictures.append(np.stack([decode_gray(each.disparity_png, bit_depth=16) for each in frames]).astype(int))
    seen = pictures[0][..., 64:], pictures[1][..., 64:]  # the town renders what is left of the image, too
    both = (seen[0] > 0) & (seen[1] > 0)
    assert both.mean() > 0.4
    assert (np.abs(seen[0] - seen[1])[both] <= 256 / 16).mean() > 0.97
