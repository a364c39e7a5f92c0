"""`convert argoverse2`: the Argoverse 2 Sensor data set as logs.

SRC/<split>/<log>/annotations.feather              boxes in the vehicle frame, with the points inside of each
SRC/<split>/<log>/city_SE3_egovehicle.feather      poses, among them one for each time of boxes
SRC/<split>/<log>/map/log_map_archive_*.json       drivable areas and crossings in the city frame
SRC/<split>/<log>/sensors/lidar/<time>.feather     sweeps in the vehicle frame, where present
SRC/<split>/<log>/sensors/cameras/stereo_front_*   undistorted images of the stereo pair, where present
SRC/<split>/<log>/sensors/cameras/ring_*           undistorted images of single cameras, where present
SRC/<split>/<log>/calibration/*.feather            of cameras, where there are images
"""

from collections import Counter
from pathlib import Path

from semgrid_eval.errors import InputError
from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs, how_to_label
from semgrid_eval.sources.argoverse2.drive import Drive
from semgrid_eval.sources.argoverse2.source import ArgoverseOptions
from semgrid_eval.sources.argoverse2.taken import Every
from semgrid_eval.words import plural

SPLITS = ("train", "val", "test")


def convert_argoverse(options: ArgoverseOptions, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of a data set; those that are up to date stay as they are.

    Raises:
        InputError: there is no such split, no log in it, or the disk is full.
    """
    drives = _drives(options)
    jobs = [ConversionJob(each.name, each.split, each.digest, each.recording) for each in drives]
    summary = convert_jobs(jobs, out, work)
    summary.remark = _remark([each for each in drives if f"{each.split}/{each.name}" not in summary.failed], out)
    return summary


def _drives(options: ArgoverseOptions) -> list[Drive]:
    there = [split for split in SPLITS if (options.src / split).is_dir()]
    for split in options.split:
        if split not in there:
            raise InputError(f"{split} is not one of: {', '.join(there) or 'none'}", path=options.src, field="split")
    chosen = [split for split in there if split in options.split or not options.split]
    found = [
        Drive(folder, split, Every(options.stereo_every, options.ring_every))
        for split in chosen
        for folder in sorted((options.src / split).iterdir())
        if folder.is_dir() and not folder.name.startswith(".")
    ]
    if not found:
        raise InputError(f"holds no log in a folder {', '.join(chosen or SPLITS)}", path=options.src)
    return found


def _remark(drives: list[Drive], out: Path) -> str:
    """Say in one line what is not there."""
    lost = sum((drive.taken.lost for drive in drives), Counter[str]())
    parts = [f"left out: {_told(lost)}"] if lost else []
    if seen := sum(bool(drive.taken.files) for drive in drives):
        parts.append(f"no labels for the cameras of {plural(seen, 'log')}: {how_to_label(out)}")
    return "; ".join(parts)


def _told(lost: Counter[str]) -> str:
    """Write how many images are left out, by why."""
    return ", ".join(f"{plural(count, 'image')} {why}" for why, count in lost.items())
