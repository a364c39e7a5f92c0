"""Hold grids of a labelled LiDAR against a camera's of the same drive, and against those of the same LiDAR later on.

Prints three tables (Markdown). The first has the share of cells of equal class among those that both sensors know, by
range, and the same of cells to which both give a static class. The second has what the camera says of the LiDAR's cells
of a class, the commonest three. The third has, within 30 m, the share of cells of equal class among those that two
grids of the LiDAR know and give a static class, the earlier one moved by the true poses, left where it was, and moved
the wrong way.

Example: python tools/compare_lidar.py logs/05_000000.mcap=cameras/kitti05_000000_000000.mcap
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from semgrid_eval.classes import CLASS_COUNT, CLASS_NAMES, DEFAULT_CLASSES, UNKNOWN
from semgrid_eval.errors import InputError, SemgridError
from semgrid_eval.geometry import SE2
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.recording import GridRecording
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.lidar import LidarSensor
from semgrid_eval.windows.grids import shift_grids, shift_in_cells

RANGES_M = ((0, 10), (10, 20), (20, 30), (30, 40), (40, 60))
STEP_FRAMES = 3  # 0.3 s at 10 Hz
WITHIN_M = 30.0
LEAST_CELLS = 100  # of a class that is told
_SAME_NS = 1_000_000
LIDAR = GridConfig(sensors={"lidar": LidarSensor()}, target=("lidar",), stretch_frames=100_000)
CAMERA = GridConfig(sensors={"camera": CameraSensor()}, target=("camera",), stretch_frames=100_000)
_STATIC = np.isin(np.arange(CLASS_COUNT), DEFAULT_CLASSES.members("static", "small_static"))
Cells = NDArray[np.uint8]
Flags = NDArray[np.bool_]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", nargs="+", metavar="LIDAR_LOG=CAMERA_LOG")
    try:
        pairs = [_paths(each) for each in parser.parse_args().pairs]
        _print_beside_cameras(pairs)
        print()
        _print_confusions(pairs)
        print()
        _print_steadiness([lidar for lidar, _ in pairs])
    except SemgridError as error:
        parser.exit(1, f"Error: {error}\n")


def _paths(text: str) -> tuple[Path, Path]:
    lidar, _, camera = text.partition("=")
    if not camera:
        raise InputError("is not LIDAR_LOG=CAMERA_LOG", field=text)
    return Path(lidar), Path(camera)


def _print_beside_cameras(pairs: list[tuple[Path, Path]]) -> None:
    print("| drive | range | both know | equal class | both static | equal class |\n|---|---|---|---|---|---|")
    for lidar_log, camera_log in pairs:
        ours, theirs = _grids_of(lidar_log, camera_log)
        for low_m, high_m in RANGES_M:
            within = _between(low_m, high_m) & (ours != UNKNOWN) & (theirs != UNKNOWN)
            static = within & _STATIC[ours] & _STATIC[theirs]
            told = " | ".join(f"{each.sum():,} | {_share(ours, theirs, each)}" for each in (within, static))
            print(f"| {lidar_log.stem} | {low_m} to {high_m} m | {told} |")


def _print_confusions(pairs: list[tuple[Path, Path]]) -> None:
    print("| drive | LiDAR says | cells | camera says |\n|---|---|---|---|")
    for lidar_log, camera_log in pairs:
        ours, theirs = _grids_of(lidar_log, camera_log)
        both = (ours != UNKNOWN) & (theirs != UNKNOWN)
        for class_id in np.unique(ours[both]):
            found = np.bincount(theirs[both & (ours == class_id)], minlength=CLASS_COUNT)
            if found.sum() >= LEAST_CELLS:
                shares = [(CLASS_NAMES[each], 100 * found[each] / found.sum()) for each in found.argsort()[:-4:-1]]
                told = ", ".join(f"{name} {share:.0f} %" for name, share in shares)
                print(f"| {lidar_log.stem} | {CLASS_NAMES[class_id]} | {found.sum():,} | {told} |")


def _print_steadiness(logs: list[Path]) -> None:
    print("| drive | both know, both static | moved by the poses | not moved | moved the wrong way |")
    print("|---|---|---|---|---|")
    for log in logs:
        (recording,) = build_log(log, LIDAR)
        place_m = _true_places(log, recording)
        found = [_steadiness(recording, sign * place_m) for sign in (1.0, 0.0, -1.0)]
        told = " | ".join(f"{100 * equal / count:.1f} %" for equal, count in found)
        print(f"| {log.stem} | {found[0][1]:,} | {told} |")


def _grids_of(lidar_log: Path, camera_log: Path) -> tuple[Cells, Cells]:
    lidar, camera = (build_log(*each)[0] for each in ((lidar_log, LIDAR), (camera_log, CAMERA)))
    return _at_the_same_times(lidar, camera)


def _at_the_same_times(lidar: GridRecording, camera: GridRecording) -> tuple[Cells, Cells]:
    """Return the grids (F, H, W) of both at frames that are equally long after their first ones."""
    lidar_ns, camera_ns = (each.stamps_ns - each.stamps_ns[0] for each in (lidar, camera))
    nearest = np.abs(camera_ns[None] - lidar_ns[:, None]).argmin(axis=1)
    same = np.abs(camera_ns[nearest] - lidar_ns) <= _SAME_NS
    return lidar.grids[0][same], camera.grids[0][nearest[same]]


def _true_places(log: Path, recording: GridRecording) -> NDArray[np.float64]:
    """Return where the vehicle truly was at each frame (F, 2), in the axes of the first one."""
    with LogReader(log) as reader:
        poses = {pose.stamp_ns: SE2(pose.x_m, pose.y_m, pose.yaw_rad) for pose in reader.poses()}
    stamps_ns = recording.stamps_ns.tolist()
    places = [poses[stamp_ns].seen_from(poses[stamps_ns[0]]) for stamp_ns in stamps_ns]
    return np.array([(place.x_m, place.y_m) for place in places])


def _steadiness(recording: GridRecording, place_m: NDArray[np.float64]) -> tuple[int, int]:
    """Count the cells of equal class, and all, that grids some frames apart both know and give a static class."""
    way_m = place_m[STEP_FRAMES:] - place_m[:-STEP_FRAMES]
    shift = torch.from_numpy(shift_in_cells(way_m, LIDAR.spec.cell_m))
    moved = shift_grids(torch.from_numpy(recording.grids[0, :-STEP_FRAMES]), shift).numpy()
    now = recording.grids[0, STEP_FRAMES:]
    both = _between(0.0, WITHIN_M) & (moved != UNKNOWN) & (now != UNKNOWN) & _STATIC[moved] & _STATIC[now]
    return int((both & (moved == now)).sum()), int(both.sum())


def _between(low_m: float, high_m: float) -> Flags:
    range_m = LIDAR.spec.ranges_m()
    return np.asarray((range_m >= low_m) & (range_m < high_m))


def _share(ours: Cells, theirs: Cells, cells: Flags) -> str:
    return f"{100 * (ours == theirs)[cells].mean():.1f} %" if cells.any() else ""


if __name__ == "__main__":
    main()
