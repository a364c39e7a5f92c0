"""KITTI's layout: what comes into logs, what is refused, in a line that names the file."""

import shutil

import numpy as np
import pytest
from click.testing import CliRunner
from support.kitti_tree import BASELINE_M, CAMERA0_M, FOCAL_PX, SCANNER_M, STEP_NS, Sequence, calibration_text

from semgrid_eval.cli.main import cli
from semgrid_eval.labels import LABEL_ID
from semgrid_eval.log.check import check_log
from semgrid_eval.log.reader import LogReader
from semgrid_eval.log.store import find_logs
from semgrid_eval.motion import EgoMotion
from semgrid_eval.recording.disparity import decoded_disparity
from semgrid_eval.recording.png import decode_gray
from semgrid_eval.sources.kitti.convert import convert_kitti
from semgrid_eval.sources.kitti.labels import CLASSES
from semgrid_eval.sources.kitti.source import KittiOptions


def converted(root, **options):
    summary = convert_kitti(KittiOptions(src=root / "src", **options), root / "logs")
    assert summary.failed == {}
    return summary


def test_points_labels_and_their_place_come_into_the_log(tmp_path):
    Sequence().write(tmp_path / "src")
    assert converted(tmp_path).written == ["val/03_000000"]
    (path,) = find_logs(tmp_path / "logs")
    assert check_log(path).findings == ()
    with LogReader(path) as log:
        assert (log.scene.dataset, log.scene.group, log.scene.cameras, log.lidars) == ("kitti", "03", (), ("top",))
        sweeps = list(log.sweeps("top"))
    assert [each.stamp_ns for each in sweeps] == [number * STEP_NS for number in range(4)]
    first = sweeps[0]
    assert first.points_m.tolist() == [[10.0, 2.0, -1.5], [20.0, -3.0, 0.5]]
    assert first.intensity.tolist() == [0.5, 0.5]
    assert first.label_id.tolist() == [LABEL_ID["road"], LABEL_ID["car"]], "a car that moves is a car"
    np.testing.assert_allclose(first.mount.ego_from_sensor.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(first.mount.place_m, np.subtract(CAMERA0_M, SCANNER_M), atol=1e-9)


@pytest.mark.parametrize("yaw_rate", [0.0, 0.5, -0.3])
def test_motion_leads_back_to_the_poses(tmp_path, yaw_rate):
    sequence = Sequence(frames=8, yaw_rate_radps=yaw_rate)
    sequence.write(tmp_path / "src")
    converted(tmp_path)
    with LogReader(find_logs(tmp_path / "logs")[0]) as log:
        samples, poses = log.motion(), log.poses()
    assert [each.speed_mps for each in samples] == pytest.approx([8.0] * 8)
    assert [each.yaw_rate_radps for each in samples] == pytest.approx([yaw_rate] * 8)
    motion = EgoMotion(samples)
    for pose in poses:
        found = motion.pose_at(pose.stamp_ns)
        assert (found.x_m, found.y_m, found.yaw_rad) == pytest.approx((pose.x_m, pose.y_m, pose.yaw_rad), abs=1e-9)
    assert poses[-1].y_m * yaw_rate >= 0.0


def test_a_pair_of_images_becomes_a_camera_with_disparity(tmp_path):
    folder = Sequence(images=True, frames=2).write(tmp_path / "src")
    told = (
        f"no labels for the cameras of 03: add them with semgrid-eval segment {tmp_path / 'logs'} --model NETWORK.onnx"
    )
    assert converted(tmp_path).remark == f"{told} --out LABELLED"
    with LogReader(find_logs(tmp_path / "logs")[0]) as log:
        calibration = log.calibration("left")
        frames = list(log.frames("left", images=True))
    assert (calibration.fx_px, calibration.baseline_m) == pytest.approx((FOCAL_PX, BASELINE_M))
    assert (calibration.x_m, calibration.y_m, calibration.z_m) == pytest.approx((1.68, 0.06, 1.65))
    assert frames[0].image_file == (folder / "image_2" / "000000.png").read_bytes()
    assert frames[0].label_png is None
    disparity_px = decoded_disparity(decode_gray(frames[0].disparity_png, bit_depth=16))
    assert np.median(disparity_px[disparity_px > 0]) == pytest.approx(8.0, abs=0.1)
    assert (disparity_px > 0).mean() > 0.5


def test_left_images_alone_are_a_camera_without_disparity(tmp_path):
    folder = Sequence(images=True, labels=None).write(tmp_path / "src")
    shutil.rmtree(folder / "image_3")
    told = "scans without labels, which a camera has to colour: 03; no right images, so no disparity: 03; no labels for"
    assert converted(tmp_path).remark.startswith(told)
    with LogReader(find_logs(tmp_path / "logs")[0]) as log:
        assert next(log.sweeps("top")).label_id is None
        calibration = log.calibration("left")
        frames = list(log.frames("left", images=True))
    assert (calibration.fx_px, calibration.baseline_m) == (pytest.approx(FOCAL_PX), None)
    assert [each.image_file for each in frames] == [
        (folder / "image_2" / f"{number:06d}.png").read_bytes() for number in range(4)
    ]
    assert {each.disparity_png for each in frames} == {None}


def test_right_images_alone_are_no_camera(tmp_path):
    folder = Sequence(images=True).write(tmp_path / "src")
    shutil.rmtree(folder / "image_2")
    told = "right images (image_3) without left ones (image_2)"
    assert converted(tmp_path).remark == f"{told}, so no camera: 03"
    shutil.rmtree(folder / "velodyne")
    summary = convert_kitti(KittiOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert list(summary.failed.values()) == [f"{folder}: holds {told}, and no scans"]


def test_the_remark_names_the_sequences_that_lack_each_thing(tmp_path):
    Sequence().write(tmp_path / "src", "03")
    Sequence(labels=None).write(tmp_path / "src", "04")
    Sequence(images=True).write(tmp_path / "src", "05")
    remark = converted(tmp_path).remark
    assert remark.startswith(
        "no images, so no camera: 03, 04; scans without labels, which a camera has to colour: 04; "
        "no labels for the cameras of 05: add them"
    )


def keep_calibration(folder, *names):
    """Leave the others out of the calibration file."""
    path = folder / "calib.txt"
    path.write_text("".join(line for line in path.read_text().splitlines(True) if line.startswith(names)))


@pytest.mark.parametrize(
    ("channels", "needed"),
    [
        (("velodyne",), ("Tr",)),
        (("velodyne", "image_2"), ("Tr", "P2")),
        (("image_2", "image_3"), ("P2", "P3")),
    ],
)
def test_of_the_calibration_only_what_is_used_is_needed(tmp_path, channels, needed):
    folder = Sequence(images=True, frames=2).write(tmp_path / "src")
    for name in {"velodyne", "image_2", "image_3"}.difference(channels):
        shutil.rmtree(folder / name)
    keep_calibration(folder, *needed)
    assert converted(tmp_path).written == ["val/03_000000"]
    for name in needed:
        keep_calibration(folder, *(other for other in needed if other != name))
        summary = convert_kitti(KittiOptions(src=tmp_path / "src"), tmp_path / "logs")
        (found,) = summary.failed.values()
        assert found.startswith(f"{folder}/calib.txt: {name}: is missing")
        (folder / "calib.txt").write_text(calibration_text())
        keep_calibration(folder, *needed)


def test_left_images_without_scans_are_refused(tmp_path):
    folder = Sequence(images=True).write(tmp_path / "src")
    for name in ("image_3", "velodyne"):
        shutil.rmtree(folder / name)
    summary = convert_kitti(KittiOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert list(summary.failed.values()) == [f"{folder}: holds neither scans nor pairs of images"]


def test_images_alone_are_enough(tmp_path):
    folder = Sequence(images=True).write(tmp_path / "src")
    shutil.rmtree(folder / "velodyne")
    converted(tmp_path)
    with LogReader(find_logs(tmp_path / "logs")[0]) as log:
        assert (log.scene.cameras, log.lidars) == (("left",), ())


def test_poses_may_lie_where_the_odometry_benchmark_has_them(tmp_path):
    folder = Sequence().write(tmp_path / "src")
    (tmp_path / "src" / "poses").mkdir()
    (folder / "poses.txt").rename(tmp_path / "src" / "poses" / "03.txt")
    assert converted(tmp_path).written == ["val/03_000000"]


def test_long_sequences_are_cut_and_what_has_not_changed_stays(tmp_path):
    folder = Sequence(frames=9).write(tmp_path / "src")
    Sequence().write(tmp_path / "src", "04")
    first = converted(tmp_path, recording_s=0.5, sequence=("03",), split="train")
    assert first.written == ["train/03_000000", "train/03_000004"]
    with LogReader(tmp_path / "logs" / "train" / "03_000004.mcap") as log:
        assert [each.stamp_ns for each in log.sweeps("top")] == [number * STEP_NS for number in range(4, 9)]
        assert log.motion()[0].stamp_ns == 4 * STEP_NS
    (folder / "labels" / "000008.label").write_bytes(np.array([40, 40], "<u4").tobytes())
    again = converted(tmp_path, recording_s=0.5, sequence=("03",), split="train")
    assert (again.written, again.skipped) == (["train/03_000004"], ["train/03_000000"])


def test_every_class_of_semantickitti_has_a_label_and_moving_ones_that_of_the_same_at_rest():
    assert len(CLASSES) == 34
    assert {label for _, label in CLASSES.values()} <= LABEL_ID.keys()
    still = dict(CLASSES.values())
    for name, label in CLASSES.values():
        if name.startswith("moving-"):
            assert still[name.removeprefix("moving-")] == label


def cut(path, count):
    path.write_bytes(path.read_bytes()[:count])


def lines(path, keep):
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:keep]))


def with_point(path, values):
    path.write_bytes(np.array([*values, 0.5], "<f4").tobytes() * 2)


FAULTS = {
    "sweep without labels": (lambda s: (s / "labels/000002.label").unlink(), "labels/000002.label: is missing"),
    "other count": (
        lambda s: cut(s / "labels/000001.label", 4),
        "labels/000001.label: has 1 label, but 000001.bin has 2 points",
    ),
    "part of a label": (
        lambda s: cut(s / "labels/000001.label", 6),
        "labels/000001.label: has 6 bytes, which are not labels of 4 bytes",
    ),
    "unknown class": (
        lambda s: (s / "labels/000003.label").write_bytes(np.array([40, 77], "<u4").tobytes()),
        "labels/000003.label: holds 77, which is not a class of SemanticKITTI",
    ),
    "lost sweep": (lambda s: (s / "velodyne/000001.bin").unlink(), "velodyne/000001.bin: is missing"),
    "part of a point": (
        lambda s: cut(s / "velodyne/000001.bin", 31),
        "velodyne/000001.bin: has 31 bytes, which are not points of 16 bytes, at most 4194304",
    ),
    "no number": (
        lambda s: with_point(s / "velodyne/000001.bin", (1.0, np.nan, 0.0)),
        "velodyne/000001.bin: point 0, (1, nan, 0) m, is not within 1000 m of the LiDAR",
    ),
    "no poses": (lambda s: (s / "poses.txt").unlink(), "poses.txt: is missing"),
    "few poses": (lambda s: lines(s / "poses.txt", 3), "poses.txt: has 3 poses; 4 are needed"),
    "few times": (lambda s: lines(s / "times.txt", 3), "times.txt: has 3 times; 4 are needed"),
    "pose of 11": (
        lambda s: (s / "poses.txt").write_text("1 " * 11 + "\n"),
        "poses.txt: line 1: has 11 numbers; 12 are needed",
    ),
    "no rotation": (
        lambda s: (s / "poses.txt").write_text("1 " * 12 + "\n"),
        "poses.txt: line 1: is not a rotation and a way",
    ),
    "pose of words": (
        lambda s: (s / "poses.txt").write_text("nan " * 12 + "\n"),
        "poses.txt: line 1: is not finite",
    ),
    "times stand": (
        lambda s: (s / "times.txt").write_text("0\n.1\n.1\n.2\n"),
        "times.txt: line 3: is not after the line before",
    ),
    "no scanner": (lambda s: lines(s / "calib.txt", 4), "calib.txt: Tr: is missing"),
    "binary": (lambda s: (s / "times.txt").write_bytes(b"\xff"), "times.txt: is not a text file"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_fails_its_sequence_alone_in_a_line(tmp_path, name):
    damage, line = FAULTS[name]
    folder = Sequence().write(tmp_path / "src", "03")
    Sequence().write(tmp_path / "src", "04")
    damage(folder)
    summary = convert_kitti(KittiOptions(src=tmp_path / "src"), tmp_path / "logs")
    assert summary.written == ["val/04_000000"]
    assert list(summary.failed.values()) == [f"{folder}/{line}"]


def test_the_command_says_it_too_and_its_exit_code_is_1(tmp_path):
    folder = Sequence().write(tmp_path / "src")
    (folder / "poses.txt").unlink()
    arguments = ["convert", "kitti", str(tmp_path / "src"), str(tmp_path / "logs"), "--workers", "1"]
    result = CliRunner().invoke(cli, arguments, standalone_mode=False)
    assert result.return_value == 1
    assert (
        f"Error: val/03: {folder}/poses.txt: is missing\n" in result.output or "poses.txt: is missing" in result.stderr
    )


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda src: src.mkdir(), "src/sequences: is not a folder"),
        (lambda src: (src / "sequences").mkdir(parents=True), "src/sequences: holds no folder of a sequence"),
    ],
)
def test_a_folder_without_sequences_is_told(tmp_path, make, line):
    make(tmp_path / "src")
    result = CliRunner().invoke(cli, ["convert", "kitti", str(tmp_path / "src"), str(tmp_path / "logs")])
    assert line in result.output or line in str(result.exception)


def test_a_sequence_that_is_not_there_is_told_with_those_that_are(tmp_path):
    Sequence().write(tmp_path / "src")
    with pytest.raises(Exception, match=r"sequences: sequence: 08 is not one of: 03$"):
        convert_kitti(KittiOptions(src=tmp_path / "src", sequence=("08",)), tmp_path / "logs")
