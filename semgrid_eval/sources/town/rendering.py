"""Renders one recording moment by moment: what the sensors see, what the vehicle reports, and the truth."""

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semgrid_eval.files import digest_value
from semgrid_eval.recording.types import Actor, Moment, MotionSample, Pose, Recording
from semgrid_eval.sources.benchmarks import RigName, Stereo
from semgrid_eval.sources.town import drives
from semgrid_eval.sources.town.bodies import actor_ids, heights_m
from semgrid_eval.sources.town.config import FRAME_COUNT
from semgrid_eval.sources.town.picture_errors import FRONT, recording_streams
from semgrid_eval.sources.town.rig import STAMP_JITTER_S, calibrations_of, looks_of, sensors_of
from semgrid_eval.sources.town.stage import Stage
from semgrid_eval.sources.town.town import load_town
from semgrid_eval.sources.town.traffic import ROAD_USERS, Snapshot
from semgrid_eval.sources.town.varied import Conditions, fixed_conditions

_APART_M = 40.0  # between two places around which the town is shown
RENDER_VERSION = 2
"""Counts changes to what a plan renders to; logs of another version are rendered again."""
CONDITIONS = 4
"""Which child of a recording's generator draws its conditions; those before are for what follows in `_moments`."""


@dataclass(frozen=True)
class RecordingPlan:
    """Everything that determines a recording; small, and cheap to send to another process."""

    name: str  # of the recording
    split: str  # `train` or `val`
    town: Path  # folder of the town
    town_digest: str  # of the town's specification
    drive: drives.Drive  # which car, from when
    seed: tuple[int, ...]  # of the recording's random numbers
    width_px: int  # of the images
    height_px: int  # of the images
    stereo: Stereo  # `modelled`, `matched`, or `exact` for perfect labels, disparity and motion
    rig: RigName = "front"  # the sensors
    dataset: str = "synthetic"  # named in the log
    drawn: Conditions | None = None  # where recordings vary; else the camera is Cityscapes' and errors are the usual

    @property
    def digest(self) -> str:
        """Digest of everything that determines the content."""
        return digest_value({"plan": self.description(), "version": RENDER_VERSION})

    @property
    def conditions(self) -> Conditions:
        """The camera, and how strong errors are."""
        return self.drawn or fixed_conditions(self.width_px, self.height_px)

    def description(self) -> dict[str, object]:
        """Return the plan as JSON values, without the place of the town on this machine."""
        values = asdict(self)
        del values["town"]
        if self.drawn is None:  # so that logs that do not vary stay what they are
            del values["drawn"]
        if self.rig == "front":  # likewise
            del values["rig"]
        if self.drive.frames == FRAME_COUNT:  # likewise
            del values["drive"]["frames"]
        return {**values, "seed": list(self.seed)}


def render_recording(plan: RecordingPlan) -> Recording:
    """Return the recording of a plan; frames are rendered one by one as they are asked for."""
    description = json.dumps(plan.description(), indent=2, sort_keys=True) + "\n"
    return Recording(
        name=plan.name,
        dataset=plan.dataset,
        split=plan.split,
        group=plan.name.partition("_")[0],  # the town: town03
        calibrations=calibrations_of(plan.rig, plan.conditions),
        source_digest=plan.digest,
        encoded_here=True,
        moments=partial(_moments, plan),
        source_files={"plan.json": description.encode()},
        conditions=plan.drawn.quantities(plan.stereo) if plan.drawn else {},
    )


def _moments(plan: RecordingPlan) -> Iterator[Moment]:
    town = load_town(plan.town)
    path = drives.ego_path(town.traffic, plan.drive)
    assert path is not None, "a plan's drive was checked when it was chosen"
    stamps, reports, *_ = recording_streams(plan.seed)
    times_s = plan.drive.start_s + np.arange(plan.drive.frames) / drives.FRAME_RATE_HZ
    times_s += np.append(0.0, stamps.normal(0.0, STAMP_JITTER_S, plan.drive.frames - 1))
    motion_noise = drives.EXACT_MOTION if plan.stereo == "exact" else plan.conditions.motion
    told = iter(_rounded(drives.report(path, times_s, motion_noise, reports)))
    stage = Stage(town, _places(path, times_s))
    sensors = sensors_of(plan.rig, plan.conditions, plan.stereo, plan.seed, stage)
    for time_s, name in looks_of(plan.rig, plan.seed, times_s):
        stamp_ns = round(time_s * 1e9)
        pose = Pose(stamp_ns, *_rounded(np.array(path.at(time_s)[:3])))
        others = stage.others(time_s, pose, plan.drive.actor)
        moment = sensors[name].observe(stage, others, time_s, pose)
        if name == FRONT:
            motion = (MotionSample(stamp_ns, *next(told)),)
            moment = replace(moment, motion=motion, actors=(*_actors(others), *_actors(stage.parked)))
        yield moment


def _places(path: drives.Trajectory, times_s: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return where the vehicle is first, and whenever it has gone farther than a drive of 30 frames goes."""
    places = [path.at(float(times_s[0]))[:2]]
    for time_s in times_s[1:]:
        here = path.at(float(time_s))[:2]
        if math.dist(here, places[-1]) > _APART_M:
            places.append(here)
    return places


def _rounded(values: NDArray[np.float64]) -> Any:  # noqa: ANN401 - floats, in lists as deep as the array
    """Round metres, radians and their rates to millionths: processors differ in the last bits of a sine."""
    return (np.round(values, 6) + 0.0).tolist()  # no -0.0


def _actors(group: Snapshot) -> list[Actor]:
    height_m = heights_m(group.actor, group.type_index)
    columns = np.column_stack([group.centre_m, group.yaw_rad, height_m, group.velocity_mps])
    found = []
    ids = actor_ids(group).tolist()
    for actor_id, type_index, values in zip(ids, group.type_index, _rounded(columns), strict=True):
        user = ROAD_USERS[type_index]
        x_m, y_m, yaw_rad, high_m, velocity_x, velocity_y = values
        size_m = (user.length_m, user.width_m, high_m)
        found.append(Actor(actor_id, user.label_id, x_m, y_m, yaw_rad, *size_m, velocity_x, velocity_y))
    return found
