"""Ring cameras of Argoverse: single cameras, whose files come as they are and whose labels colour the sweeps."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra `argoverse` is not installed")

from support.argoverse_log import (
    PLANE_M,
    RING,
    RING_OFFSET_NS,
    START_NS,
    STEP_NS,
    STEREO_STEP_NS,
    WALLS,
    camera_tables,
    on_wall,
    write_argoverse,
    write_table,
)
from support.commands import run_command

from semgrid_eval.classes import CLASS_NAMES, UNKNOWN
from semgrid_eval.config import parse_config
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.sensors.projection import unit_projection
from semgrid_eval.sources.argoverse2.convert import ArgoverseOptions, convert_argoverse

STAMPS_NS = [START_NS + RING_OFFSET_NS + number * STEREO_STEP_NS for number in range(4)]
FRONT, REAR = RING
AXLE_M = 0.32
GRID = parse_config(
    GridConfig,
    {
        "spec": {"agent_row": 64},
        "morphology": "off",
        "sensors": {"top": {"kind": "lidar", "colour_from": {"camera": list(RING)}}},
        "target": ["top"],
    },
)


@pytest.fixture
def folder(tmp_path):
    return write_argoverse(tmp_path / "src", ring=True)


def converted(tmp_path, **options):
    summary = convert_argoverse(ArgoverseOptions(src=tmp_path / "src", **options), tmp_path / "logs")
    assert summary.failed == {}
    return tmp_path / "logs" / "val" / "drive.mcap", summary


def frames(log, name):
    with LogReader(log) as reader:
        return list(reader.frames(name, images=True))


def test_files_are_untouched_and_have_their_own_times(folder, tmp_path):
    log, summary = converted(tmp_path, ring_every=1)
    assert summary.remark.startswith("no labels for the cameras of 1 log: add them with semgrid-eval segment")
    with LogReader(log) as reader:
        assert reader.scene.cameras == (FRONT, REAR)
        assert [reader.is_single(name) for name in RING] == [True, True]
        assert [reader.image_size(name) for name in RING] == [(388, 512), (512, 388)]
    for name in RING:
        files = sorted((folder / "sensors" / "cameras" / name).iterdir())
        found = frames(log, name)
        assert [each.stamp_ns for each in found] == STAMPS_NS
        assert [each.image_file for each in found] == [path.read_bytes() for path in files]
    assert {finding.place for finding in check_log(log).findings} == {
        f"/camera/{name}/label: missing_beside" for name in RING
    }


def test_every_second_image_is_taken_and_none_if_so_asked(folder, tmp_path):
    log, _ = converted(tmp_path)
    assert [each.stamp_ns for each in frames(log, FRONT)] == STAMPS_NS[::2]
    log, summary = converted(tmp_path, ring_every=0)
    with LogReader(log) as reader:
        assert reader.scene.cameras == ()
    assert summary.remark == ""


def test_images_beyond_the_boxes_are_left_out_and_a_camera_of_such_alone(folder, tmp_path):
    for name, moved in ((FRONT, 1), (REAR, 4)):
        for path in sorted((folder / "sensors" / "cameras" / name).iterdir())[:moved]:
            path.rename(path.with_name(f"{int(path.stem) - 10**9}.jpg"))
    log, _ = converted(tmp_path, ring_every=1)
    with LogReader(log) as reader:
        assert reader.scene.cameras == (FRONT,)
    assert [each.stamp_ns for each in frames(log, FRONT)] == STAMPS_NS[1:]


@pytest.mark.parametrize("name", RING)
def test_the_calibration_in_the_log_projects_the_wall_to_where_it_was_drawn(folder, tmp_path, name):
    log, _ = converted(tmp_path)
    met_m = on_wall(name, WALLS[name][0])[::50, ::50].reshape(-1, 3) + np.array([0.0, 0.0, AXLE_M])
    with LogReader(log) as reader:
        width, height = reader.image_size(name)
        projection = unit_projection(reader.calibration(name), (width, height))
    u, v, depth_m = projection @ np.column_stack([met_m, np.ones(len(met_m))]).T
    columns, rows = np.meshgrid(np.arange(0, width, 50), np.arange(0, height, 50))
    np.testing.assert_allclose(u / depth_m * width - 0.5, columns.ravel(), atol=1e-3)
    np.testing.assert_allclose(v / depth_m * height - 0.5, rows.ravel(), atol=1e-3)


def test_beside_the_stereo_pair_all_are_there(tmp_path):
    write_argoverse(tmp_path / "src", ring=True, stereo=True)
    log, _ = converted(tmp_path)
    with LogReader(log) as reader:
        assert reader.scene.cameras == (FRONT, REAR, "stereo_front_left")
        assert not reader.is_single("stereo_front_left")


def write_walls(folder):
    """Sweeps of both walls, at the first three times of boxes."""
    across_m, up_m = (each.ravel() for each in np.meshgrid(np.arange(-3.0, 12.0, 0.1), np.arange(0.0, 2.0, 0.2)))
    walls = [np.column_stack([np.full(across_m.shape, x_m), across_m, up_m]) for x_m in (PLANE_M, -PLANE_M)]
    points = np.concatenate(walls)
    for number in range(3):
        columns = {axis: points[:, place].tolist() for place, axis in enumerate("xyz")}
        path = folder / "sensors" / "lidar" / f"{START_NS + number * STEP_NS}.feather"
        write_table(path, {**columns, "intensity": [1] * len(points)})


def test_sweeps_coloured_by_labelled_ring_images_make_the_grid_that_was_drawn(folder, tmp_path):
    """Ahead the wall is a car left of 0.5 m and road right of it; behind, road left of 5 m and a car right of it."""
    pytest.importorskip("onnxruntime", reason="the extra `segment` is not installed")
    pytest.importorskip("onnx", reason="onnx, which makes the models, is not installed")
    from support.coloured import TRAIN_COLOURS
    from support.onnx_models import FLAT, colour_network

    write_walls(folder)
    converted(tmp_path)
    colour_network(tmp_path / "network.onnx", colours=TRAIN_COLOURS)
    line = ["segment", f"{tmp_path}/logs", "--model", f"{tmp_path}/network.onnx", "--out", f"{tmp_path}/labelled"]
    flat = [word for name, values in FLAT.items() for word in (f"--{name}", *map(str, values))]
    ended = run_command([*line, *flat, "--workers", "1"])
    assert ended.code == 0, ended.err
    (grids,) = build_log(Path(tmp_path, "labelled/val/drive.mcap"), GRID)
    (found,) = grids.grids[:, 0]
    forward_m, left_m = GRID.spec.centres_m()
    ahead, behind = (np.abs(forward_m - x_m) < 1 for x_m in (PLANE_M, -PLANE_M))
    car, road = (CLASS_NAMES.index(name) for name in ("car", "road"))
    assert set(found[ahead][:, (left_m > 1.4) & (left_m < 4)].ravel()) == {UNKNOWN, car}
    assert set(found[ahead][:, (left_m < -0.4) & (left_m > -3)].ravel()) == {UNKNOWN, road}
    assert set(found[behind][:, (left_m > 5.9) & (left_m < 11)].ravel()) == {UNKNOWN, road}
    assert set(found[behind][:, (left_m < 4.1) & (left_m > 0.5)].ravel()) == {UNKNOWN, car}


FAULTS = {
    "size": (
        lambda folder: cv2.imwrite(str(folder / f"sensors/cameras/{REAR}/{STAMPS_NS[0]}.jpg"), np.zeros((100, 200))),
        f"sensors/cameras/{REAR}/{STAMPS_NS[0]}.jpg: is 200 x 100, but intrinsics.feather calibrates 512 x 388",
    ),
    "no camera": (
        lambda folder: write_table(folder / "calibration/intrinsics.feather", camera_tables()[0]),
        f"calibration/intrinsics.feather: sensor_name: has 0 rows of {FRONT}; one is needed "
        "(--ring-every 0 leaves images out)",
    ),
    "no calibration": (
        lambda folder: (folder / "calibration/intrinsics.feather").unlink(),
        "calibration/intrinsics.feather: is missing (--ring-every 0 leaves images out)",
    ),
}


def test_without_calibration_of_both_kinds_of_cameras_both_options_are_told(tmp_path):
    folder = write_argoverse(tmp_path / "src", ring=True, stereo=True)
    path = folder / "calibration" / "egovehicle_SE3_sensor.feather"
    path.unlink()
    summary = convert_argoverse(ArgoverseOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert list(summary.failed.values()) == [f"{path}: is missing (--stereo-every 0 --ring-every 0 leaves images out)"]


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_fails_its_log_alone_in_a_line(folder, tmp_path, name):
    damage, line = FAULTS[name]
    write_argoverse(tmp_path / "src", "other")
    damage(folder)
    summary = convert_argoverse(ArgoverseOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert summary.written == ["val/other"]
    assert list(summary.failed.values()) == [f"{folder}/{line}"]
