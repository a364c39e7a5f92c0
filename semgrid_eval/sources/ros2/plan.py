"""What becomes of a bag: its recordings, and what was left out of them."""

from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from semgrid_eval.errors import InputError
from semgrid_eval.sources.ros2.bag import Bag, name_of
from semgrid_eval.sources.ros2.frames import FramePlan, covered, frames_of, stretches, sweeps_of
from semgrid_eval.sources.ros2.kinds import IMU
from semgrid_eval.sources.ros2.lidars import odd_times, plan_lidar
from semgrid_eval.sources.ros2.mapping import BagMap
from semgrid_eval.sources.ros2.motion import Floats, Rates, rates_of
from semgrid_eval.sources.ros2.recording import AROUND_NS, Stretch
from semgrid_eval.sources.ros2.rig import plan_rig
from semgrid_eval.sources.ros2.scan import Facts, scan


@dataclass(frozen=True)
class Cut:
    """Which split the recordings of a bag belong to, and how long they are at most (0: as long as they come)."""

    split: str
    longest_s: float


@dataclass
class BagPlan:
    """What becomes of one bag."""

    name: str
    stretches: list[Stretch] = field(default_factory=list)
    frames: int = 0  # that have been recorded, of all cameras; sweeps of all LiDARs
    lost: Counter[str] = field(default_factory=Counter)  # frames that are left out, by what they lack
    repeated: int = 0  # messages with the stamp of another one
    odd_times: list[str] = field(default_factory=list)  # what is odd in times of points, LiDAR by LiDAR
    fault: str = ""  # why there are no recordings


def plan_bag(path: Path, mapping: BagMap, cut: Cut) -> BagPlan:
    """Read a bag once, and plan its recordings; what is wrong with it is its fault, and others go on."""
    plan = BagPlan(name_of(path))
    try:
        with Bag(path) as bag:
            facts = scan(bag, mapping)
    except InputError as error:
        plan.fault = str(error)
        return plan
    try:
        _fill(plan, path, mapping, cut, facts)
    except InputError as error:
        plan.fault = str(InputError(str(error), path=path))
    return plan


def _fill(plan: BagPlan, path: Path, mapping: BagMap, cut: Cut, facts: Facts) -> None:
    rates = _rates(mapping, facts)
    rigs = {name: plan_rig(camera, mapping.vehicle, facts) for name, camera in mapping.cameras.items()}
    lidars = {name: plan_lidar(lidar, mapping.vehicle, facts) for name, lidar in mapping.lidars.items()}
    odd = (odd_times(name, lidar, facts) for name, lidar in mapping.lidars.items())
    plan.odd_times = [each for each in odd if each]
    by_sensor = _frames(plan, mapping, facts, rates)
    stretch = partial(
        Stretch,
        bag=path,
        split=cut.split,
        group=plan.name,
        clock=mapping.clock,
        kinds=facts.kinds,
        lidars=lidars,
    )
    for first, frames in stretches(by_sensor, mapping.single, cut.longest_s, plan.lost):
        motion = rates.between(frames[0].stamp_ns - AROUND_NS, frames[-1].stamp_ns + AROUND_NS)
        seen = {frame.sensor for frame in frames}
        plan.stretches.append(
            stretch(
                name=f"{plan.name}_{first:06d}",
                rigs={name: rig for name, rig in rigs.items() if name in seen},
                frames=tuple(frames),
                motion=motion,
            )
        )
    if not plan.stretches:
        raise InputError(f"gives no recording; {told(plan.lost)}")


def _frames(plan: BagPlan, mapping: BagMap, facts: Facts, rates: Rates) -> dict[str, list[FramePlan]]:
    """Return the frames of all cameras and the sweeps of all LiDARs that can be used, in the order of the map."""
    found = {}
    for name, camera in mapping.cameras.items():
        whole = frames_of(name, camera, facts.arrivals, mapping.tolerance_s, plan.lost)
        found[name] = covered(whole, rates.stamps_ns, plan.lost)
        plan.frames += len(facts.arrivals[camera.main_topic].stamps_ns)
    for name, lidar in mapping.lidars.items():
        sweeps = sweeps_of(name, facts.arrivals[lidar.cloud])
        found[name] = covered(sweeps, rates.stamps_ns, plan.lost)
        plan.frames += len(sweeps)
    used = {topic for camera in mapping.cameras.values() for topic in camera.pictures().values()}
    used |= {lidar.cloud for lidar in mapping.lidars.values()}
    plan.repeated = sum(facts.arrivals[topic].repeated for topic in used)
    return found


def _rates(mapping: BagMap, facts: Facts) -> Rates:
    motion = mapping.motion
    turn = _imu_turn(mapping, facts) if facts.kinds[motion.turning.topic] == IMU else None
    return rates_of(motion, facts.tracks["speed"], facts.tracks["yaw_rate"], turn)


def _imu_turn(mapping: BagMap, facts: Facts) -> Floats:
    """Return the vehicle's z axis in the frame of the Imu (3,)."""
    turning = mapping.motion.turning
    frame = facts.frames[turning.topic]
    if turning.aligned or frame == mapping.vehicle.frame:
        return np.array([0.0, 0.0, 1.0])
    turn: Floats = facts.transforms.lookup(mapping.vehicle.frame, frame).rotation[2]
    return turn


def told(lost: Counter[str]) -> str:
    """Say how many frames were left out, and why."""
    parts = [f"{count} {why}" for why, count in sorted(lost.items()) if count]
    return f"frames left out: {', '.join(parts)}" if parts else "no frame left out"
