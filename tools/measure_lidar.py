"""Measure the errors of the simulated LiDAR: labels of points against exact ones, and how many points come back.

Example: python tools/measure_lidar.py --cache towns
"""

# ruff: noqa: T201 - the result goes to stdout

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.labels import LABEL_ID
from semgrid_eval.progress import silent
from semgrid_eval.recording.types import Pose
from semgrid_eval.sources.benchmarks import load_benchmark
from semgrid_eval.sources.town.convert import config_of
from semgrid_eval.sources.town.drives import ego_path
from semgrid_eval.sources.town.lidar import RANGE_M, Lidar, LidarErrors, LidarNoise
from semgrid_eval.sources.town.recordings import plan_recordings
from semgrid_eval.sources.town.rendering import RecordingPlan
from semgrid_eval.sources.town.rig import ROOF
from semgrid_eval.sources.town.sensors import View
from semgrid_eval.sources.town.solids import Soup
from semgrid_eval.sources.town.stage import Stage
from semgrid_eval.sources.town.town import load_town

_SWEEPS = 4  # of a recording


def seen(plan: RecordingPlan, lidar: Lidar) -> Iterator[tuple[View, Soup]]:
    """Yield what the LiDAR sees in a few sweeps of a recording."""
    town = load_town(plan.town)
    path, start_s = ego_path(town.traffic, plan.drive), plan.drive.start_s
    assert path is not None
    stage = Stage(town, [path.at(start_s)[:2]])
    for time_s in start_s + 0.1 * np.arange(_SWEEPS):
        pose = Pose(0, *path.at(time_s)[:3])
        scenery = stage.scenery(stage.others(time_s, pose, plan.drive.actor), time_s, pose)
        yield scenery.seen_by(lidar), scenery.soup


def measured(cache: Path) -> tuple[NDArray[np.int64], float]:
    """Return the confusion of labels (256, 256), exact ones along the first axis, and the mean points of a sweep."""
    plans = plan_recordings(config_of(load_benchmark("town-v1"), "small"), cache, silent)
    lidar, confusion, points = Lidar(ROOF), np.zeros((256, 256), np.int64), list[int]()
    for plan in plans[5:300:25]:  # one of each training town
        labels, ranges = (LidarErrors(lidar, LidarNoise(), np.random.default_rng(plan.seed)) for _ in range(2))
        for view, soup in seen(plan, lidar):
            there = (view.depth_m <= RANGE_M[1]) & (view.label != LABEL_ID["sky"])
            np.add.at(confusion, (view.label[there], labels.labelled(view.label)[there]), 1)
            points.append(len(ranges.sweep(0, view, soup).points_m))
    return confusion, float(np.mean(points))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True, help="folder of towns")
    confusion, points = measured(parser.parse_args().cache)
    right, union = np.diag(confusion), confusion.sum(axis=0) + confusion.sum(axis=1) - np.diag(confusion)
    there = confusion.sum(axis=1) > 0
    print(f"labels: accuracy {right.sum() / confusion.sum():.3f}, mean IoU {(right[there] / union[there]).mean():.3f}")
    print(f"points of a sweep: {points:,.0f}")
