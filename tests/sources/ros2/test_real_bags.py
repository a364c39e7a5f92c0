"""Bags of real recordings, where folders of them are named, and of a town's stereo pairs.

SEMGRID_REAL_DATA names a tree in Cityscapes' layout, SEMGRID_REAL_LIDAR one of SemanticKITTI.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from support.bags import RecordingBag, Variant
from support.rig_bags import Coding, RigBag
from support.town_pairs import matched_drive
from support.towns import small_plans

from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sensors.lidar import LidarSensor
from semgrid_eval.sources.cityscapes.tree import CityscapesOptions, find_sequences
from semgrid_eval.sources.kitti.convert import convert_kitti
from semgrid_eval.sources.kitti.source import KittiOptions
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

REAL, REAL_LIDAR = (os.environ.get(f"SEMGRID_REAL_{name}", "") for name in ("DATA", "LIDAR"))


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


@pytest.mark.skipif(not Path(REAL_LIDAR, "sequences").is_dir(), reason="SEMGRID_REAL_LIDAR names no SemanticKITTI")
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_lidar_grids_of_a_real_bag_are_those_of_its_files(tmp_path, storage):
    convert_kitti(KittiOptions(src=Path(REAL_LIDAR), sequence=("07",)), tmp_path / "kitti")
    (files,) = find_logs(tmp_path / "kitti")
    recording = read_recording(files)
    labels = sorted(Path(REAL_LIDAR, "sequences", "07", "labels").glob("*.label"))
    stamps_ns = [moment.stamp_ns for moment in recording.moments()]
    raw = dict(zip(stamps_ns, (np.fromfile(path, "<u4") for path in labels), strict=True))
    bag = RigBag(recording, Coding(labels="u4"), raw)
    bag.write(tmp_path / "drive", storage)
    (tmp_path / "map.yaml").write_text(bag.map_text(ids="semantickitti"))
    convert_bags(Ros2Options(bag=(tmp_path / "drive",), map=str(tmp_path / "map.yaml")), tmp_path / "logs")
    config = GridConfig(sensors={"top": LidarSensor()}, target=("top",))
    found, expected = (build_log(log, config)[0].grids for log in (*find_logs(tmp_path / "logs"), files))
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
