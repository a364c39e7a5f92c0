"""Write SemanticKITTI as ROS 2 bags, convert them, and hold grids against those of its own files.

Prints two tables (Markdown). The first has, for each way of writing clouds, the share of cells that are equal to those
of `convert kitti`, of all cells and of those that either knows. The second is of bags that hold the camera of the same
drives, too: how far the grids of the LiDAR agree with the camera's and with its own labels' if the camera colours its
points, by range, beside the same of its own labels; and which share of points and of cells gets a class.

Frames of TREE, a Cityscapes sequence tree, and of SRC are the same in the order of time.

Example: PYTHONPATH=.:tests python tools/compare_clouds.py SRC TREE --labels TREE/pred_sequence --out build/clouds
"""

# ruff: noqa: T201 - what it measures goes to stdout

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from support.rig_bags import Coding, RigBag

from semgrid_eval.errors import SemgridError
from semgrid_eval.grids.build import build_log
from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.convert import Work
from semgrid_eval.log.store import find_logs, read_recording
from semgrid_eval.recording.types import Moment, Recording
from semgrid_eval.sensors.camera import CameraSensor
from semgrid_eval.sensors.lidar import ColourFrom, LidarSensor
from semgrid_eval.sensors.sensor import SensorConfig
from semgrid_eval.sources.cityscapes.source import CityscapesOptions
from semgrid_eval.sources.cityscapes.tree import find_sequences
from semgrid_eval.sources.kitti.convert import convert_kitti
from semgrid_eval.sources.kitti.source import KittiOptions
from semgrid_eval.sources.ros2.convert import convert_bags
from semgrid_eval.sources.ros2.options import Ros2Options

CODINGS = {
    "float32, labels uint32 of SemanticKITTI": ("mcap", Coding(labels="u4")),
    "the same, sqlite3": ("sqlite3", Coding(labels="u4")),
    "float64, labels uint16": ("mcap", Coding("f8")),
    "big-endian": ("mcap", Coding(big=True)),
    "organised in 64 padded rows, NaN where there is no point": ("mcap", Coding(rows=64, padding=8)),
}
RANGES_M = ((0, 10), (10, 20), (20, 30), (30, 40), (40, 60))
LIDAR = GridConfig(sensors={"top": LidarSensor()}, target=("top",))
SENSORS: dict[str, SensorConfig] = {
    "own": LidarSensor(),
    "coloured": LidarSensor(colour_from=ColourFrom()),
    "unhidden": LidarSensor(colour_from=ColourFrom(occlusion_rad=0.0)),
    "camera": CameraSensor(),
}
Cells = NDArray[np.uint8]


def main() -> None:
    """Parse the options, convert, compare, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("src", type=Path)
    parser.add_argument("tree", type=Path)
    parser.add_argument("--labels", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    try:
        convert_kitti(KittiOptions(src=options.src), options.out / "kitti")
        recordings = {log.stem: read_recording(log) for log in find_logs(options.out / "kitti")}
        _print_codings(recordings, options.src, options.out)
        print()
        tree = CityscapesOptions(src=options.tree, labels=options.labels)
        _print_colours([_with_camera(each, tree) for each in recordings.values()], options.out / "coloured")
    except SemgridError as error:
        raise SystemExit(f"Error: {error}") from None


def _print_codings(recordings: dict[str, Recording], src: Path, out: Path) -> None:
    expected = {log.stem: _grids(log, LIDAR)[0] for log in find_logs(out / "kitti")}
    print("| clouds | equal cells | of those that either knows |\n|---|---|---|")
    for number, (what, (storage, coding)) in enumerate(CODINGS.items()):
        raw = coding.labels == "u4"
        bags = [
            RigBag(each, coding, _raw_labels(each, src) if raw else {}).write(out / str(number) / each.name, storage)
            for each in recordings.values()
        ]
        text = RigBag(next(iter(recordings.values())), coding).map_text(ids="semantickitti" if raw else "label_ids")
        found = {log.stem[: -len("_000000")]: _grids(log, LIDAR)[0] for log in _logs(bags, text)}
        ours, theirs = (np.concatenate([grids[name] for name in recordings]) for grids in (found, expected))
        equal, known = ours == theirs, (ours > 0) | (theirs > 0)
        print(f"| {what} | {equal.mean():.2%} | {equal[known].mean():.2%} |", flush=True)


def _raw_labels(recording: Recording, src: Path) -> dict[int, NDArray[np.uint32]]:
    """Return the labels in SemanticKITTI's files, by the stamps of a recording of a whole sequence."""
    files = sorted((src / "sequences" / recording.group / "labels").glob("*.label"))
    moments = recording.moments()
    return {moment.stamp_ns: np.fromfile(path, "<u4") for moment, path in zip(moments, files, strict=True)}


def _logs(bags: list[Path], text: str) -> list[Path]:
    folder = bags[0].parent.with_name(f"{bags[0].parent.name}-logs")
    (map_file := folder.with_suffix(".yaml")).write_text(text)
    summary = convert_bags(Ros2Options(bag=tuple(bags), map=str(map_file)), folder, Work(workers=1))
    for reason in summary.failed.values():
        raise SystemExit(f"Error: {reason}")
    return find_logs(folder)


def _with_camera(recording: Recording, tree: CityscapesOptions) -> Recording:
    """Add the frames of the camera of the same drive."""
    sequence = next(each for each in find_sequences(tree) if each.city == f"kitti{recording.group}").recording()

    def moments() -> Iterator[Moment]:
        for swept, seen in zip(recording.moments(), sequence.moments(), strict=True):
            cameras = {name: replace(frame, stamp_ns=swept.stamp_ns) for name, frame in seen.cameras.items()}
            yield replace(swept, cameras=cameras)

    return replace(recording, calibrations=sequence.calibrations, moments=moments)


def _print_colours(recordings: list[Recording], out: Path) -> None:
    bags = [RigBag(each).write(out / each.name) for each in recordings]
    print("| drive | range | own labels as the camera's | coloured as the camera's | coloured as own labels |")
    print("|---|---|---|---|---|")
    shares = []
    for log in _logs(bags, RigBag(recordings[0]).map_text()):
        own, coloured, unhidden, camera = _grids(log, GridConfig(sensors=SENSORS, target=("own",)))
        for low_m, high_m in RANGES_M:
            within = _between(low_m, high_m)
            told = [_share(*pair, within) for pair in ((own, camera), (coloured, camera), (coloured, own))]
            print(f"| {log.stem} | {low_m} to {high_m} m | {' | '.join(told)} |")
        ahead = _between(0, 60) & (camera > 0)
        hidden = [_share(each, camera, ahead) for each in (coloured, unhidden)]
        known = [f"{100 * (each > 0).sum() / (own > 0).sum():.0f} %" for each in (coloured, unhidden)]
        shares.append(f"{log.stem}: cells known of those of own labels {known}, equal to the camera's {hidden}")
    print("\n".join(["", "By default and with `occlusion_rad: 0`:", *shares]))


def _grids(log: Path, config: GridConfig) -> Cells:
    (recording,) = build_log(log, config)
    return recording.grids


def _between(low_m: float, high_m: float) -> NDArray[np.bool_]:
    range_m = LIDAR.spec.ranges_m()
    return np.asarray((range_m >= low_m) & (range_m < high_m))


def _share(ours: Cells, theirs: Cells, cells: NDArray[np.bool_]) -> str:
    both = cells & (ours > 0) & (theirs > 0)
    return f"{100 * (ours == theirs)[both].mean():.1f} % of {both.sum():,}" if both.any() else ""


if __name__ == "__main__":
    main()
