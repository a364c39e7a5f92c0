"""`convert ros2`: bags as logs, by a map of their topics."""

import logging
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from semgrid_eval.executors import WorkerDied, local_executor
from semgrid_eval.log.convert import IN_PROCESS, ConversionJob, ConversionSummary, Work, convert_jobs, how_to_label
from semgrid_eval.recording.disparity import CODING_ERROR_PX, LARGEST_PX
from semgrid_eval.sources.ros2.bag import name_of
from semgrid_eval.sources.ros2.inspection import inspect_bags
from semgrid_eval.sources.ros2.mapping import BagMap, load_map
from semgrid_eval.sources.ros2.options import Ros2Options
from semgrid_eval.sources.ros2.plan import BagPlan, Cut, plan_bag, told
from semgrid_eval.sources.ros2.recording import Stretch
from semgrid_eval.words import plural

_log = logging.getLogger(__name__)
_TOLD_AT_M = 50.0


def convert_bags(options: Ros2Options, out: Path, work: Work = IN_PROCESS) -> ConversionSummary:
    """Write the logs of bags; those that are up to date stay as they are.

    Raises:
        InputError: the map cannot be used, two recordings have one name, or the disk is full.
    """
    mapping, cut = load_map(Path(options.map)), Cut(options.split, options.recording_s)
    plans = _plans(options.bag, mapping, cut, work)
    jobs = [job for plan in plans for job in _jobs(plan, options.split)]
    for odd in next((plan.odd_times for plan in plans if plan.odd_times), []):
        _log.warning("%s", odd)
    summary = convert_jobs(jobs, out, work)
    summary.remark = _remark([plan for plan in plans if not plan.fault], mapping, out)
    return summary


def inspect(options: Ros2Options) -> str:
    """List what bags hold, and write a first map of the first of them where there is none yet."""
    return inspect_bags(options.bag, Path(options.map))


def _plans(bags: Sequence[Path], mapping: BagMap, cut: Cut, work: Work) -> list[BagPlan]:
    """Read all bags once, several at a time."""
    found: dict[int, BagPlan] = {}
    with work.stage("scan") as progress:
        scans = local_executor(work.workers).run(partial(plan_bag, mapping=mapping, cut=cut), bags)
        for done, (index, plan) in enumerate(scans, start=1):
            name = name_of(bags[index])
            found[index] = BagPlan(name, fault=plan.reason) if isinstance(plan, WorkerDied) else plan
            progress(done, len(bags), name)
    return [found[index] for index in sorted(found)]


def _jobs(plan: BagPlan, split: str) -> list[ConversionJob]:
    if plan.fault:
        return [ConversionJob.failing(plan.name, split, plan.fault)]
    return [ConversionJob(each.name, split, each.digest, each.recording) for each in plan.stretches]


def _remark(plans: Sequence[BagPlan], mapping: BagMap, out: Path) -> str:
    """Say in one line what was kept and what was left out."""
    if not plans:
        return ""
    lost = sum((plan.lost for plan in plans), Counter[str]())
    total, kept = sum(plan.frames for plan in plans), sum(len(each.frames) for plan in plans for each in plan.stretches)
    what = "frames and sweeps" if mapping.lidars else "frames"
    parts = [f"{kept} of {total} {what}; {told(lost)}", *_codings(plans[0])]
    if repeated := sum(plan.repeated for plan in plans):
        parts.append(f"{plural(repeated, 'message')} with a stamp that was there before left out")
    if mapping.single:
        worth = "labels of theirs can colour the points of a LiDAR: `colour_from` of the sensor"
        parts.append(f"nothing tells the depth of {', '.join(sorted(mapping.single))}; {worth}")
    parts += _absences([each for plan in plans for each in plan.stretches], mapping)
    unlabelled = [name for name, camera in mapping.cameras.items() if camera.labels is None]
    if unlabelled:
        parts.append(f"no labels for {', '.join(unlabelled)}: {how_to_label(out)}")
    if bare := [name for name, lidar in mapping.lidars.items() if lidar.label_field is None]:
        advice = "a grid needs `label_field` in the map, or a camera to colour them: `colour_from` of the sensor"
        parts.append(f"points of {', '.join(bare)} have no labels: {advice}")
    return "; ".join(parts)


def _absences(recordings: Sequence[Stretch], mapping: BagMap) -> list[str]:
    """Say for each camera how many recordings are without it."""
    counts = {name: sum(name not in each.rigs for each in recordings) for name in mapping.cameras}
    total = plural(len(recordings), "recording")
    return [f"{name} has no frame in {count} of {total}" for name, count in counts.items() if count]


def _codings(plan: BagPlan) -> list[str]:
    """Say for each camera what its depth loses in the coding of logs."""
    found = []
    deep = {name: rig for name, rig in plan.stretches[0].rigs.items() if not rig.camera.is_single}
    for name, rig in deep.items():
        depth_px = rig.calibration.depth_disparity_m_px
        coded = f"{name}: disparity is rounded by at most 1/{1 / CODING_ERROR_PX:g} px"
        at_m, nearest_m = _TOLD_AT_M**2 / depth_px * CODING_ERROR_PX, depth_px / LARGEST_PX
        found.append(f"{coded}, {at_m:.3f} m at {_TOLD_AT_M:g} m; what is nearer than {nearest_m:.2f} m has none")
    return found
