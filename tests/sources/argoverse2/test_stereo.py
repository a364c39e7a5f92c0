"""The stereo pair of Argoverse: rectified and matched it tells how far a wall is; faults are told in a line."""

import numpy as np
import pytest

pytest.importorskip("pyarrow", reason="the extra `argoverse` is not installed")

from support.argoverse_log import (
    PLANE_M,
    START_NS,
    STEREO_OFFSET_NS,
    STEREO_SIZE,
    STEREO_STEP_NS,
    camera_tables,
    write_argoverse,
    write_small_images,
    write_table,
)

from semgrid_eval.geometry import SE3
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sources.argoverse2.convert import ArgoverseOptions, convert_argoverse
from semgrid_eval.sources.argoverse2.pairs import LEFT, RIGHT
from semgrid_eval.sources.argoverse2.stereo import StereoCamera

STAMPS_NS = [START_NS + STEREO_OFFSET_NS + number * STEREO_STEP_NS for number in range(4)]
AXLE_M = 0.32


@pytest.fixture
def folder(tmp_path):
    return write_argoverse(tmp_path / "src", stereo=True)


def converted(tmp_path, **options):
    return convert_argoverse(ArgoverseOptions(src=tmp_path / "src", **options), tmp_path / "logs")


def frames(tmp_path, **options):
    summary = converted(tmp_path, **options)
    assert summary.failed == {}
    log = tmp_path / "logs" / "val" / "drive.mcap"
    with LogReader(log) as reader:
        return reader.scene.cameras, list(reader.frames(LEFT, images=True)) if reader.scene.cameras else []


def test_disparity_tells_how_far_the_wall_is(folder, tmp_path):
    """Every matched pixel, taken to the vehicle by the calibration in the log, lies on the wall that was drawn.

    Matching leans towards whole pixels, by up to .4 px, in which direction depends on the wall's distance.
    """
    _, (first, *_) = frames(tmp_path)
    with LogReader(tmp_path / "logs" / "val" / "drive.mcap") as reader:
        calibration = reader.calibration(LEFT)
    disparity_px = decoded_disparity(decode_gray(first.disparity_png, bit_depth=16))
    assert disparity_px.shape == STEREO_SIZE[::-1]
    rows, columns = np.nonzero(disparity_px)
    assert len(rows) > 0.5 * disparity_px.size
    rays = np.stack(
        [
            (columns - calibration.u0_px) / calibration.fx_px,
            (rows - calibration.v0_px) / calibration.fy_px,
            np.ones(len(rows)),
        ],
        axis=-1,
    )
    ego_from_optical = calibration.ego_from_optical
    directions = SE3(ego_from_optical.rotation, np.zeros(3)).apply(rays)
    depth_m = (PLANE_M - ego_from_optical.translation_m[0]) / directions[:, 0]
    known_px = calibration.fx_px * calibration.baseline_m / depth_m
    error_px = np.abs(disparity_px[rows, columns] - known_px)
    assert np.mean(error_px < 0.5) > 0.98


def test_the_camera_is_where_the_left_one_is_above_the_ground(folder):
    calibration = StereoCamera(folder).calibration
    assert (calibration.x_m, calibration.y_m) == pytest.approx((1.625064, 0.250715))
    assert calibration.z_m == pytest.approx(1.190953 + AXLE_M)
    assert calibration.baseline_m == pytest.approx(0.498452, abs=1e-5)
    assert max(abs(calibration.roll_rad), abs(calibration.pitch_rad), abs(calibration.yaw_rad)) < 0.02


def test_the_lens_of_which_images_are_rid_is_not_undone_again(folder):
    before = StereoCamera(folder).calibration
    table = camera_tables()[0]
    for name in ("k1", "k2", "k3"):
        del table[name]
    write_table(folder / "calibration" / "intrinsics.feather", table)
    assert StereoCamera(folder).calibration == before


def test_images_keep_their_own_times_and_motion_those_of_boxes(folder, tmp_path):
    cameras, found = frames(tmp_path, stereo_every=1)
    assert cameras == (LEFT,)
    assert [each.stamp_ns for each in found] == STAMPS_NS
    assert all(each.label_png is None and each.image_file for each in found)
    log = tmp_path / "logs" / "val" / "drive.mcap"
    assert [str(each) for each in check_log(log).findings if "label" not in str(each)] == []
    with LogReader(log) as reader:
        assert not {each.stamp_ns for each in reader.motion()} & set(STAMPS_NS)
        assert len(list(reader.actors())) == len(reader.motion())


def test_every_second_pair_is_taken_and_none_if_so_asked(folder, tmp_path):
    assert [each.stamp_ns for each in frames(tmp_path)[1]] == STAMPS_NS[::2]
    assert frames(tmp_path, stereo_every=0)[0] == ()


def test_the_remark_says_how_to_get_labels(folder, tmp_path):
    assert converted(tmp_path).remark == (
        f"no labels for the cameras of 1 log: add them with semgrid-eval segment {tmp_path / 'logs'} "
        "--model NETWORK.onnx --out LABELLED"
    )


def test_an_image_alone_and_those_beyond_the_boxes_are_left_out(folder, tmp_path):
    images = folder / "sensors" / "cameras"
    sorted((images / RIGHT).iterdir())[1].unlink()
    for name in (LEFT, RIGHT):
        first = min((images / name).iterdir())
        first.rename(first.with_name(f"{START_NS - 1}.jpg"))
    assert [each.stamp_ns for each in frames(tmp_path, stereo_every=1)[1]] == STAMPS_NS[2:]
    remark = converted(tmp_path, stereo_every=1).remark
    assert remark.startswith("left out: 2 images outside the boxes' times, 1 image without a partner; no labels")


def test_a_lost_partner_leaves_the_longest_part_without_a_hole(folder, tmp_path):
    sorted((folder / "sensors" / "cameras" / RIGHT).iterdir())[1].unlink()
    assert [each.stamp_ns for each in frames(tmp_path)[1]] == STAMPS_NS[::2], "it is not one of those taken"
    assert [each.stamp_ns for each in frames(tmp_path, stereo_every=1)[1]] == STAMPS_NS[2:]
    remark = converted(tmp_path, stereo_every=1).remark
    assert remark.startswith("left out: 1 image without a partner, 2 images before or after a hole; no labels")


def test_images_after_the_last_box_alone_are_no_camera(folder, tmp_path):
    for name in (LEFT, RIGHT):
        for path in sorted((folder / "sensors" / "cameras" / name).iterdir()):
            path.rename(path.with_name(f"{int(path.stem) + 10**9}.jpg"))
    summary = converted(tmp_path)
    assert summary.written == ["val/drive"]
    assert summary.remark == "left out: 8 images outside the boxes' times"
    assert frames(tmp_path)[0] == ()


def no_right(folder):
    for path in (folder / "sensors" / "cameras" / RIGHT).iterdir():
        path.unlink()


def late(folder):
    for path in sorted((folder / "sensors" / "cameras" / RIGHT).iterdir()):
        path.rename(path.with_name(f"{int(path.stem) + 20_000_000}.jpg"))


def smaller(folder):
    write_small_images(folder / "sensors" / "cameras")


def cut(folder):
    path = folder / "sensors" / "cameras" / LEFT / f"{STAMPS_NS[0]}.jpg"
    path.write_bytes(path.read_bytes()[:2000])


def with_intrinsics(change):
    def damage(folder):
        table = camera_tables()[0]
        change(table)
        write_table(folder / "calibration" / "intrinsics.feather", table)

    return damage


def other_way_round(folder):
    table = camera_tables()[1]
    table["sensor_name"].reverse()
    write_table(folder / "calibration" / "egovehicle_SE3_sensor.feather", table)


IMAGES, INTRINSICS = "sensors/cameras", "calibration/intrinsics.feather"
PLACES = "calibration/egovehicle_SE3_sensor.feather"
FAULTS = {
    "no right": (no_right, f"{IMAGES}/stereo_front_right: holds no image, but stereo_front_left holds 4"),
    "late": (late, f"{IMAGES}/stereo_front_right: holds no image within 5 ms of one of stereo_front_left"),
    "size": (
        smaller,
        f"{IMAGES}/{LEFT}/{STAMPS_NS[0]}.jpg: is 200 x 100, but intrinsics.feather calibrates 512 x 388",
    ),
    "cut": (cut, f"{IMAGES}/{LEFT}/{STAMPS_NS[0]}.jpg: is a damaged JPEG file: ..."),
    "no calibration": (
        lambda folder: (folder / INTRINSICS).unlink(),
        f"{INTRINSICS}: is missing (--stereo-every 0 leaves images out)",
    ),
    "no camera": (
        with_intrinsics(lambda table: table["sensor_name"].__setitem__(1, "ring_front_left")),
        f"{INTRINSICS}: sensor_name: has 0 rows of {RIGHT}; one is needed (--stereo-every 0 leaves images out)",
    ),
    "focal length": (
        with_intrinsics(lambda table: table["fx_px"].__setitem__(0, -1.0)),
        f"{INTRINSICS}: fx_px: row 0: -1 is not positive",
    ),
    "nan": (
        with_intrinsics(lambda table: table["cx_px"].__setitem__(1, np.nan)),
        f"{INTRINSICS}: cx_px: row 1: nan is not finite",
    ),
    "sizes": (
        with_intrinsics(lambda table: table["width_px"].__setitem__(1, 500)),
        f"{INTRINSICS}: width_px, height_px: stereo_front_right is 500 x 388, but stereo_front_left is 512 x 388",
    ),
    "other way round": (other_way_round, f"{PLACES}: P says that the right camera is ..."),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_fails_its_log_alone_in_a_line(folder, tmp_path, name):
    damage, line = FAULTS[name]
    write_argoverse(tmp_path / "src", "other")
    damage(folder)
    summary = converted(tmp_path)
    assert summary.written == ["val/other"]
    (found,) = summary.failed.values()
    expected = f"{folder}/{line}"
    assert "\n" not in found
    assert found.startswith(expected[:-3]) if expected.endswith("...") else found == expected
