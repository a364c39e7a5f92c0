"""What is known of real LiDARs and tracks, where folders of them are named.

SEMGRID_REAL_LIDAR names a folder in SemanticKITTI's layout, SEMGRID_REAL_TRACKS one in Argoverse's, SEMGRID_REAL_DATA a
Cityscapes tree whose recordings `kitti05` and `kitti07` are the same frames as sequences 05 and 07 of the first.
"""

import os
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from support.pages import ROOT

from semgrid_eval.cli.main import cli
from semgrid_eval.grids.build import build_log
from semgrid_eval.log.store import find_logs, read_recording, write_log
from semgrid_eval.scores.metrics.iou import class_iou
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.results import read_run, result_folder
from semgrid_eval.scores.sums import read_sums

LIDAR, TRACKS, CAMERAS = (os.environ.get(f"SEMGRID_REAL_{name}", "") for name in ("LIDAR", "TRACKS", "DATA"))
needs_lidar = pytest.mark.skipif(not Path(LIDAR, "sequences").is_dir(), reason="SEMGRID_REAL_LIDAR names no sequences")
needs_tracks = pytest.mark.skipif(not Path(TRACKS, "val").is_dir(), reason="SEMGRID_REAL_TRACKS names no logs")
needs_cameras = pytest.mark.skipif(not Path(CAMERAS, "camera").is_dir(), reason="SEMGRID_REAL_DATA names no tree")
TOOL = runpy.run_path(str(ROOT / "tools" / "compare_lidar.py"))


def command(*arguments):
    result = CliRunner().invoke(cli, [*arguments, "--workers", "1"], standalone_mode=False)
    assert result.return_value == 0, result.output


@needs_lidar
def test_sweeps_moved_by_the_poses_agree_and_moved_the_wrong_way_do_not(tmp_path):
    command("convert", "kitti", LIDAR, f"{tmp_path}/logs")
    for log in find_logs(tmp_path / "logs"):
        (recording,) = build_log(log, TOOL["LIDAR"])
        place_m = TOOL["_true_places"](log, recording)
        right, still, wrong = (np.divide(*TOOL["_steadiness"](recording, sign * place_m)) for sign in (1.0, 0.0, -1.0))
        assert right >= 0.9
        assert right > still > wrong


@needs_lidar
@needs_cameras
def test_a_lidar_and_the_camera_of_the_same_drive_agree_on_static_cells_nearby(tmp_path):
    command("convert", "kitti", LIDAR, f"{tmp_path}/logs")
    command("convert", "cityscapes", CAMERAS, f"{tmp_path}/cameras", "--labels", f"{CAMERAS}/pred_sequence")
    for log in find_logs(tmp_path / "logs"):
        camera = tmp_path / "cameras" / "val" / f"kitti{log.stem}_000000.mcap"
        (lidar,), (other,) = build_log(log, TOOL["LIDAR"]), build_log(camera, TOOL["CAMERA"])
        ours, theirs = TOOL["_at_the_same_times"](lidar, other)
        assert len(ours) == 10
        static = TOOL["_between"](0.0, 20.0) & TOOL["_STATIC"][ours] & TOOL["_STATIC"][theirs]
        static &= (ours > 0) & (theirs > 0)
        assert (ours == theirs)[static].mean() > 0.85


def turned_round(moment):
    motion = [replace(each, speed_mps=-each.speed_mps, yaw_rate_radps=-each.yaw_rate_radps) for each in moment.motion]
    return replace(moment, motion=tuple(motion))


def scores(folder, logs, names):
    grid = {"sensors": {"tracks": {"kind": "tracks"}}, "target": ["tracks"], "stretch_frames": 160}
    known = {
        "BL-NT": {"model": "newest", "translate": False},
        "BL-DC": {"model": "newest"},
        "BL-Flow": {"model": "flow"},
    }
    matrix = {
        "defaults": {"grid": grid, "window": {"step_frames": 3, "target_frame": None}},
        "rows": [{"name": name, **known[name]} for name in names],
    }
    (folder / "m.yaml").write_text(yaml.safe_dump(matrix))
    command("run", f"{folder}/m.yaml", "--logs", str(logs), "--out", f"{logs}-run", "--no-pictures", "--device", "cpu")
    found = {}
    for row in read_run(Path(f"{logs}-run")).rows:
        counts = read_sums(result_folder(Path(f"{logs}-run"), row.results[0]), "iou", "all")[:, 0]
        found[row.name] = IOU.means(class_iou(counts.sum(axis=0)))["mean_known"]
    return found


@needs_tracks
def test_tracks_have_the_known_order_of_baselines_and_motion_of_the_wrong_sign_is_last(tmp_path):
    pytest.importorskip("pyarrow", reason="the extra `argoverse` is not installed")
    command("convert", "argoverse2", TRACKS, f"{tmp_path}/logs")
    for log in find_logs(tmp_path / "logs"):
        recording = read_recording(log)
        moments = lambda recording=recording: map(turned_round, recording.moments())  # noqa: E731
        write_log(replace(recording, moments=moments), tmp_path / "wrong" / "val" / log.name)
    right = scores(tmp_path, tmp_path / "logs", ("BL-NT", "BL-DC", "BL-Flow"))
    wrong = scores(tmp_path, tmp_path / "wrong", ("BL-DC",))
    assert right["BL-Flow"] > right["BL-DC"] > right["BL-NT"] > wrong["BL-DC"]
