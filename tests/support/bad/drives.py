"""Bad drives of SemanticKITTI and Argoverse, and grids that ask for what a log's LiDAR does not have."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from support.argoverse_log import (
    RING,
    STEREO,
    camera_tables,
    columns,
    pose_columns,
    write_argoverse,
    write_small_images,
    write_table,
)
from support.bad.case import Bad, Kind
from support.kitti_tree import Sequence
from support.single import single_rig
from support.swept import recorded, sweep
from support.toy_world import street

from semgrid_eval.log.store import write_log

KITTI = "convert kitti KITTI new --workers 1"
ARGOVERSE = "convert argoverse2 AV new --workers 1"
FOLDER = Path("KITTI/sequences/03")
BOXES, POSES = (Path("AV/val/drive", name) for name in ("annotations.feather", "city_SE3_egovehicle.feather"))

RING_LEFT = "ring_rear_left"
IMAGES, INTRINSICS = Path("AV/val/drive/sensors/cameras"), Path("AV/val/drive/calibration/intrinsics.feather")


def whole() -> None:
    """Write a sequence of each data set, and logs of which one has bare sweeps, one images without labels, too."""
    Sequence().write(Path("KITTI"))
    write_argoverse(Path("AV"), stereo=True, ring=True)
    write_log(street(1, frames=4).recording(), Path("camera/a.mcap"))
    write_log(single_rig(frames=4), Path("single/a.mcap"))
    for folder, calibrations in (("bare", {}), ("unlabelled", {"front": street(1).calibration()})):
        recording = recorded(lambda seen=bool(calibrations): _moments(seen=seen))
        write_log(replace(recording, calibrations=calibrations), Path(folder, "a.mcap"))


def _moments(*, seen: bool) -> Iterator[Any]:
    for moment in street(1, frames=4).recording().moments():
        cameras = {name: replace(frame, label_png=None) for name, frame in moment.cameras.items()} if seen else {}
        yield replace(moment, cameras=cameras, sweeps={"top": sweep(moment.stamp_ns, [(5.0, 0.0, 0.0)])})


def _file(words: str, name: str, content: bytes) -> Bad:
    return Bad(words, KITTI, {str(FOLDER / name): content})


def _points(*rows: tuple[float, ...]) -> bytes:
    return np.array(rows, "<f4").tobytes()


def _ids(*ids: int) -> bytes:
    return np.array(ids, "<u4").tobytes()


def _gone(words: str, name: str) -> Bad:
    return Bad(words, KITTI, spoil=lambda: (FOLDER / name).unlink())


def _images_alone(channel: str) -> None:
    """Leave only images of one side, and of the calibration what places the scanner."""
    rmtree(FOLDER)
    Sequence(images=True).write(Path("KITTI"))
    rmtree(FOLDER / ("image_3" if channel == "image_2" else "image_2"))
    calibration = FOLDER / "calib.txt"
    calibration.write_text(calibration.read_text().splitlines()[-1])


def _right_images_alone() -> None:
    _images_alone("image_3")
    rmtree(FOLDER / "velodyne")


def _table(words: str, path: Path, make: Callable[[], dict[str, list[Any]]], change: Callable[..., object]) -> Bad:
    def spoil() -> None:
        table = make()
        change(table)
        write_table(path, table)

    return Bad(words, ARGOVERSE, spoil=spoil)


def _cell(column: str, value: object) -> Callable[[dict[str, list[Any]]], object]:
    return lambda table: table[column].__setitem__(5, value)


def _intrinsics(words: str, cameras: dict[str, Any]) -> Bad:
    return _table(words, INTRINSICS, lambda: camera_tables(cameras)[0], lambda table: None)


def _grid(words: str, logs: str, sensor: str) -> Bad:
    text = f"sensors: {{a: {sensor}}}\ntarget: [a]\n"
    return Bad(words, f"grids {logs} grids --config grid.yaml --workers 1", {"grid.yaml": text.encode()})


DRIVES = Kind(
    "Drives of SemanticKITTI and Argoverse",
    "A sequence of four scans with labels, and a drive of six times with boxes and images of stereo pair and ring.",
    whole,
    (
        _file("labels of another count than points", "labels/000001.label", _ids(40)),
        _gone("a scan without labels beside others", "labels/000002.label"),
        _file("a class that SemanticKITTI does not have", "labels/000003.label", _ids(40, 77)),
        _file("a part of a point", "velodyne/000001.bin", b"0" * 31),
        _file("a point that is not a number", "velodyne/000001.bin", _points((1, np.nan, 0, 0), (1, 2, 3, 0))),
        _gone("a lost scan", "velodyne/000002.bin"),
        _gone("no poses", "poses.txt"),
        Bad("right images without left ones, and no scans", KITTI, spoil=_right_images_alone),
        Bad("a camera that is not calibrated", KITTI, spoil=lambda: _images_alone("image_2")),
        _table("a box that is not a number", BOXES, columns, _cell("tx_m", float("nan"))),
        _table("a box of an unknown category", BOXES, columns, _cell("category", "TANK")),
        _table("boxes without poses", POSES, lambda: pose_columns(3), lambda table: None),
        Bad("one camera of the stereo pair", ARGOVERSE, spoil=lambda: rmtree(IMAGES / "stereo_front_right")),
        Bad("images of another size than the calibration", ARGOVERSE, spoil=lambda: write_small_images(IMAGES)),
        Bad("images without calibration", ARGOVERSE, spoil=INTRINSICS.unlink),
        _intrinsics("images of the pair that is not calibrated", RING),
        _intrinsics("images of ring cameras that are not calibrated", STEREO),
        Bad(
            "images of a ring camera of another size",
            ARGOVERSE,
            spoil=lambda: write_small_images(IMAGES, RING_LEFT),
        ),
    ),
)
GRIDS = Kind(
    "Grids of LiDARs",
    "A grid's sensors, asked of a log with a camera, with sweeps without labels, with these and a camera without, and "
    "with two cameras without disparity.",
    whole,
    (
        _grid("a LiDAR, where there is none", "camera", "{kind: lidar}"),
        _grid("a LiDAR of another name", "bare", "{kind: lidar, lidar: roof}"),
        _grid("a kind that is not known", "camera", "{kind: lidr}"),
        _grid("a camera's setting", "bare", "{kind: lidar, top_px: 3}"),
        _grid("points without labels", "bare", "{kind: lidar}"),
        _grid("points coloured by a camera, where there is none", "bare", "{kind: lidar, colour_from: {}}"),
        _grid("points coloured by an absent camera", "unlabelled", "{kind: lidar, colour_from: {camera: rear}}"),
        _grid("points coloured by a camera without labels", "unlabelled", "{kind: lidar, colour_from: {}}"),
        _grid("points of a camera without disparity", "single", "{camera: left}"),
        _grid("points coloured by one of two cameras, not named", "single", "{kind: lidar, colour_from: {}}"),
        _grid("points coloured by no camera", "single", "{kind: lidar, colour_from: {camera: []}}"),
        _grid("a second camera to colour points, absent", "single", "{kind: lidar, colour_from: {camera: [left, up]}}"),
        _grid("colour_from is a name", "unlabelled", "{kind: lidar, colour_from: front}"),
        _grid("colours of a time too long ago", "unlabelled", "{kind: lidar, colour_from: {within_s: 5}}"),
        _grid("points hidden far aside of another", "unlabelled", "{kind: lidar, colour_from: {occlusion_rad: 4}}"),
    ),
)
KINDS = (DRIVES, GRIDS)
